defmodule Mix.Tasks.Convoy.New do
  @shortdoc "Makes an app for missions, behaviours, drivers and formations of your own"
  @moduledoc """
  Makes an app of your own beside those of Convoy: `apps/NAME` with its `mix.exs`, `lib` and `test`. Nothing is overwritten.

      mix convoy.new mine

  NAME is also what its modules begin with (`mine`: `Mine`). `docs/extending.md` says what may stand in it.

  `--help` lists the options.
  """
  use Mix.Task
  alias Mix.Generator

  @impl Mix.Task
  def run(words), do: Hal.Cli.Command.run("convoy.new", words, {@moduledoc, []}, &make/2)

  defp make(_options, [name]) do
    module = Macro.camelize(name)
    folder = Path.join("apps", name)

    cond do
      not (name =~ ~r/^[a-z][a-z0-9_]{0,29}$/) ->
        refused(
          "expected a name such as mine (a to z, 0 to 9, _; up to 30), got #{inspect(name)}"
        )

      not File.exists?("support.exs") ->
        refused("this is not Convoy's top folder, which has apps and support.exs")

      File.exists?(folder) ->
        refused("#{folder} exists, and nothing is overwritten; take another name")

      taken?("#{name}.app") or taken?("Elixir.#{module}.beam") ->
        refused("#{name} is a name of Erlang, Elixir or Convoy; take another one")

      true ->
        Generator.create_file(Path.join(folder, "mix.exs"), project(name, module))
        Generator.create_directory(Path.join(folder, "lib"))
        Generator.create_file(Path.join(folder, "test/test_helper.exs"), "ExUnit.start()\n")
    end
  end

  defp make(_options, names),
    do: refused("expected one name, as in mix convoy.new mine, got #{length(names)}")

  defp refused(line), do: {:error, "convoy.new: " <> line}

  defp taken?(file), do: :code.where_is_file(String.to_charlist(file)) != :non_existing

  defp project(name, module) do
    """
    Code.require_file("../../support.exs", __DIR__)

    defmodule #{module}.MixProject do
      use Mix.Project

      def project, do: Convoy.Support.project(:#{name}, deps: [{:lab, in_umbrella: true}])

      def application, do: [extra_applications: [:logger]]
    end
    """
  end
end
