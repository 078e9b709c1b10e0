# The helpers of the tests in network namespaces. What of them runs on other nodes is shipped there, as `{module, code}`;
# a file that two tests require is compiled for the first of them only.
modules = for file <- ~w(robot story fleet caller), do: Code.require_file("#{file}.exs", __DIR__)

:persistent_term.put(:netns_modules, List.flatten(modules))
