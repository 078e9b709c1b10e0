defmodule Lab.Node do
  @moduledoc """
  Runs one robot, or the world, of a `Lab.Fleet.Nodes`, as the main program of an operating-system process.

  The first line of its standard input is its whole configuration (`Lab.Fleet.Nodes.Config`), so that
  nothing of it is on a command line. With it the process becomes a node, starts its part, and
  tells the launcher, a process on another node. It ends when standard input closes, because then
  nobody needs it any more.

  Its messages to the launcher go through `Lab.Node.Reporter`.
  """
  alias Lab.Fleet.Nodes
  alias Lab.Node.Reporter

  @doc "A part of a fleet in a node of its own: a robot or the world."
  @callback start(options :: map()) ::
              {:ok, supervisor :: pid(), facts :: map(), report :: {module(), atom(), list()}}

  @doc "Called when the launcher says that all nodes are up."
  @callback begin(options :: map()) :: :ok

  @doc "Starts what standard input specifies; for `erl -s`."
  @spec main() :: pid()
  def main, do: spawn(&run/0)

  defp run do
    :ok = :io.setopts(:standard_io, [:binary])

    case Nodes.Config.read(IO.gets("")) do
      {:ok, config} ->
        spawn_link(&watch/0)
        become(config)

      {:error, line} ->
        fail(line)
    end
  end

  # Nothing more arrives until the end.
  defp watch do
    case IO.gets("") do
      line when is_binary(line) -> watch()
      _closed -> :erlang.halt(0, flush: false)
    end
  end

  defp become(config) do
    Application.put_env(:logger, :level, :error)
    Application.put_env(:swarm, :mesh, config.mesh)

    case Node.start(config.node, :longnames) do
      {:ok, _kernel} ->
        {:ok, _apps} = Application.ensure_all_started(:lab)
        start(config)

      {:error, _reason} ->
        fail("#{config.node} cannot start: is there a node of this name already?")
    end
  end

  defp start(%{part: {module, options}} = config) do
    Process.flag(:trap_exit, true)
    {:ok, supervisor, facts, report} = module.start(options)
    {:ok, reporter} = Reporter.start_link(config.launcher, report)
    Reporter.tell(reporter, {:up, Map.put(facts, :main, self())})
    wait(supervisor, reporter, config.part)
  end

  defp wait(supervisor, reporter, {module, options} = part) do
    receive do
      :begin ->
        module.begin(options)
        wait(supervisor, reporter, part)

      {:EXIT, ^supervisor, reason} ->
        fail("its parts have ended: #{inspect(reason, limit: 20)}")

      {:EXIT, ^reporter, reason} ->
        fail("its reporter has ended: #{inspect(reason, limit: 20)}")

      _other ->
        wait(supervisor, reporter, part)
    end
  end

  @spec fail(String.t()) :: no_return()
  defp fail(line) do
    IO.puts(line)
    System.halt(1)
  end
end
