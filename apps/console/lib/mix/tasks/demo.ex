defmodule Mix.Tasks.Demo do
  @shortdoc "A fleet finds its landmark, elects a leader and follows it in formation"
  @moduledoc """
  Runs the demo; `mix demo --help` lists its options.

  Exit status: 0 the fleet ended in formation, 2 it did not, 1 something was wrong with the input.
  """
  use Mix.Task
  alias Console.{Build, Demo, Live, Options, Session}

  @impl Mix.Task
  def run(arguments) do
    Build.update()

    # No application is started: a run needs neither nodes nor servers of ours.
    status =
      case Options.parse(arguments, System.get_env("CONVOY_FROM", ".")) do
        {:ok, %Options{help: true}} -> IO.write(Options.help())
        {:ok, %Options{headless: true} = options} -> Demo.run(options, Sim.Trial)
        {:ok, options} -> Session.run(options, Live.Trial, &Live.Trial.start_link(Sim.Trial, &1))
        {:error, lines} -> refuse(lines)
      end

    if is_integer(status) and status > 0, do: exit({:shutdown, status})
  end

  defp refuse(lines) do
    Enum.each(lines, &IO.puts(:stderr, "demo: #{&1}"))
    IO.puts(:stderr, "demo: --help lists all options")
    1
  end
end
