defmodule Swarm.Replacement.Rehearsal do
  @moduledoc false
  # Tries what an order brings before robots run it: loads object code in a VM of its own, since damaged code can abort the
  # VM that loads it, and no exception tells of that; and makes a state of the mission, which is thrown away. Its caller is
  # a process that may end.
  alias Robot.Mission
  alias Swarm.Replacement.Order

  @boot_ms 5_000
  @load_ms 2_000

  @doc """
  Loads modules there, all or none; the error is one line. Waits for it, #{div(@boot_ms + @load_ms, 1_000)} s at most. Links the
  calling process to that VM: if it aborts, the caller ends.
  """
  @spec load([{module(), binary()}]) :: :ok | {:error, line :: String.t()}
  def load(modules) do
    {:ok, peer, _node} = :peer.start_link(vm())
    loaded = :peer.call(peer, :code, :atomic_load, [files(modules)], @load_ms)
    :ok = :peer.stop(peer)

    case loaded do
      :ok ->
        :ok

      {:error, [{module, why} | _]} ->
        {:error, "#{inspect(module)} cannot be loaded: #{inspect(why)}"}
    end
  end

  defp files(modules), do: for({module, beam} <- modules, do: {module, ~c"rehearsed", beam})

  @doc "The options as this mission checks them, after it has made a state by them for each robot; the error is one line."
  @spec init(module(), Order.t(), [atom()]) :: {:ok, keyword()} | {:error, line :: String.t()}
  def init(module, order, robots) do
    with {:ok, options} <- options(order),
         {:ok, options} <- Mission.check_options(module, options, length(robots)) do
      for robot <- robots do
        {phase, _mission, effects} = module.init(robot, options)
        true = is_atom(phase) and is_list(effects)
      end

      {:ok, options}
    end
  end

  defp options(order) do
    with :error <- Order.options(order),
         do: {:error, "its options have names that its code does not know"}
  end

  # Without our code, a name, or a dump of what it held.
  defp vm do
    root = to_string(:code.root_dir())
    erts = "erts-#{:erlang.system_info(:version)}"

    erl =
      Enum.find(
        [Path.join([root, "bin", "erl"]), Path.join([root, erts, "bin", "erl"])],
        &File.exists?/1
      )

    %{
      connection: :standard_io,
      exec: to_charlist(erl || "erl"),
      args:
        Enum.map(
          ~w(+S 1:1 +SDio 1 +A 1 +sbwt none -kernel logger_level none) ++ boot(root),
          &to_charlist/1
        ),
      env: for({name, value} <- env(), do: {to_charlist(name), to_charlist(value)}),
      wait_boot: @boot_ms,
      shutdown: :close
    }
  end

  # A release has its boot files among its own.
  defp boot(root) do
    case Path.wildcard(Path.join(root, "releases/*/start_clean.boot")) do
      [file | _] ->
        ["-boot", Path.rootname(file), "-boot_var", "RELEASE_LIB", Path.join(root, "lib")]

      [] ->
        []
    end
  end

  defp env do
    none = for name <- ~w(ERL_FLAGS ERL_AFLAGS ERL_ZFLAGS ERL_LIBS), do: {name, ""}
    [{"ERL_CRASH_DUMP_SECONDS", "0"} | none]
  end
end
