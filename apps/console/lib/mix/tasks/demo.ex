defmodule Mix.Tasks.Demo do
  @shortdoc "A fleet finds its landmark, elects a leader and follows it in formation"
  @moduledoc """
  Runs the demo; `mix demo --help` lists its options.

  Live, every robot is a tree of processes of its own, in real time. A fleet too large for the
  machine's processors runs in lockstep instead, as slowly as necessary, unless there are nodes or
  hardware.

  Exit status: 0 if the fleet ended in formation, or a person at a terminal has quit; 2 if it did
  not; 1 if the input was wrong, or the run ended before its time.
  """
  use Mix.Task
  alias Console.{Demo, Live, Options, Report}
  alias Console.Terminal.Session
  alias Lab.Fleet

  # Twenty robots take a third of a processor, fifty a whole one, because all hear all.
  @robots_a_processor 20

  # A node needs a thirtieth of a processor, and more with every other node.
  @nodes_a_processor 15

  @impl Mix.Task
  def run(arguments) do
    Hal.Cli.Command.run("demo", fn ->
      # Robots are killed here on purpose, and reports of their supervisors would spoil the screen.
      Logger.configure(level: :none)

      case Options.parse(arguments, System.get_env("CONVOY_FROM", ".")) do
        {:ok, %Options{help: true}} ->
          IO.write(Options.help())

        {:ok, options} ->
          with :ok <- Report.check(options), :ok <- doors(options), do: play(options)

        errors ->
          errors
      end
    end)
  end

  # What a node lets in is decided when its Erlang starts.
  defp doors(%{nodes: true}) do
    if :init.get_argument(:proto_dist) == :error,
      do:
        {:error, "--nodes needs bin/demo, which starts Erlang so that not everybody may connect"},
      else: :ok
  end

  defp doors(_one_process), do: :ok

  defp play(options) do
    warn(options)
    if options.world, do: Enum.each(options.world.notes, &IO.puts(:stderr, &1))

    cond do
      options.headless and Options.real_time?(options) ->
        recorded(options, &Demo.run(&1, Fleet, paced()))

      options.headless ->
        Lab.Trial.Memory.prepare(length(options.robots))
        Demo.run(options, Lab.Trial)

      true ->
        live(options)
    end
  end

  defp paced,
    do: [lines: &Fleet.lines/1, ended: &Fleet.ended/1, stop: &Fleet.stop/1]

  defp lockstep(%{record: nil} = options, pace),
    do: Session.run(options, Live.Trial, &Live.Trial.start_link(Lab.Trial, &1, pace))

  defp lockstep(options, pace) do
    Live.Recording.lockstep(options, fn options, setup, recorder ->
      start = fn _trial ->
        Live.Trial.start_recorded(setup, pace, recorder, options.record_pictures)
      end

      Session.run(options, Live.Trial, start)
    end)
  end

  defp recorded(options, play), do: Live.Recording.run(options, play)

  defp warn(%{nodes: true, robots: robots}),
    do: warn("processes", length(robots), @nodes_a_processor)

  defp warn(%{hardware: [_ | _], robots: robots}),
    do: warn("robots", length(robots), @robots_a_processor)

  defp warn(_lockstep_at_need), do: :ok

  defp warn(what, count, a_processor) do
    most = a_processor * System.schedulers_online()

    if count > most do
      IO.puts(
        :stderr,
        "demo: #{count} #{what} may be too many for this machine; up to #{most} keep real time"
      )
    end
  end

  defp live(options) do
    cond do
      processes?(options) -> recorded(options, &live_fleet/1)
      options.incidents != nil -> Live.Recording.refused_incidents(options)
      true -> lockstep(options, Console.Pace.new(options.speed || 1.0))
    end
  end

  defp live_fleet(options),
    do: Session.run(options, Live.Fleet, fn trial -> Live.Fleet.start_link(trial) end)

  defp processes?(options),
    do: Options.real_time?(options) or (options.speed == nil and few?(options.robots))

  defp few?(robots), do: length(robots) <= @robots_a_processor * System.schedulers_online()
end
