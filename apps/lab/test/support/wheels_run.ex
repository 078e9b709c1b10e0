defmodule Lab.WheelsRun do
  @moduledoc """
  Sequences of orders and faults on a robot in a VM of its own (`Lab.VmRobots`), held against `Sim.WheelsModel`: a
  speed other than zero that comes on its line while its wheels may not turn is a violation.
  """
  import Lab.VmRobots
  alias Robot.Names
  alias Sim.{Emulator, WheelsModel}

  # For what the line brings after the answer: an emulated base may get no processor for a moment.
  @late_ms 150
  # How long a person tries again what is refused because the line is not back.
  @patience_ms 2_000
  # In which a robot that moves by itself would.
  @look_ms 400

  @doc """
  Runs sequences of `steps` drawn steps, one for each of these seeds. Returns how often the robot was ordered to drive,
  and drove; or the violation: the seed, the steps with their answers until then, and how many milliseconds after the
  last one the first speed came.
  """
  def run(robots, id, seeds, steps) do
    Enum.reduce_while(seeds, {:ok, %{sequences: 0, ordered: 0, drove: 0}}, fn seed, {:ok, all} ->
      case sequence(robots, id, seed, steps) do
        {:ok, counts} -> {:cont, {:ok, Map.merge(all, counts, fn _key, a, b -> a + b end)}}
        violation -> {:halt, violation}
      end
    end)
  end

  defp sequence(robots, id, seed, count) do
    {steps, _rand} = WheelsModel.draw(count, :rand.seed_s(:exsss, seed))

    # From a robot that stands and is not held, whatever the sequence before left. One whose device was killed too
    # often has ended, and is started again, as systemd does it.
    if status(robots, id) == nil, do: start_robot(robots, id)
    Swarm.Case.eventually(fn -> swarm(robots, :disarm, [id]) == :ok end)
    Swarm.Case.eventually(fn -> swarm(robots, :reset, []) == :ok end)

    run = %{
      model: %{WheelsModel.new(robots.arms[id]) | armed?: false},
      # Since when nothing may come; `nil` while something may.
      still_ms: now_ms() + @late_ms,
      done: [],
      counts: %{sequences: 1, ordered: 0, drove: 0}
    }

    Enum.reduce_while(steps, run, fn step, run ->
      run = take(robots, id, step, run)

      case run.still_ms && Enum.reverse(moves(robots, id, run.still_ms)) do
        [first | _] -> {:halt, {:moved, first - run.still_ms, run}}
        _none -> {:cont, run}
      end
    end)
    |> case do
      {:moved, after_ms, run} -> {:violation, id, seed, Enum.reverse(run.done), after_ms}
      run -> {:ok, run.counts}
    end
  end

  defp take(robots, id, step, run) do
    {answer, at_ms} = carry_out(robots, id, step)
    model = WheelsModel.step(run.model, step, answer)
    run = %{run | model: model, done: [{step, answer} | run.done]}

    cond do
      WheelsModel.may_turn?(model) and step == :drive and answer == :ok ->
        drove? = watch(@look_ms, fn -> moves(robots, id, at_ms) != [] end)
        counts = %{run.counts | ordered: run.counts.ordered + 1}
        counts = if drove?, do: %{counts | drove: counts.drove + 1}, else: counts
        %{run | still_ms: nil, counts: counts}

      WheelsModel.may_turn?(model) ->
        %{run | still_ms: nil}

      true ->
        still_ms = run.still_ms || at_ms
        watch(@look_ms, fn -> moves(robots, id, still_ms) != [] end)
        %{run | still_ms: still_ms}
    end
  end

  defp carry_out(robots, _id, {:freeze, ms}) do
    signal(robots, "STOP")
    pass(ms)
    # What was written before the freeze came long ago.
    at_ms = now_ms() - 50
    signal(robots, "CONT")
    {nil, at_ms}
  end

  defp carry_out(robots, id, {:freeze_program, ms}) do
    case port_program(robots, id) do
      nil ->
        {nil, now_ms() + @late_ms}

      program ->
        Vm.signal(program, "STOP")
        Swarm.Case.eventually(fn -> frozen_or_gone?(program) end)
        pass(ms)
        at_ms = now_ms()
        Vm.signal(program, "CONT")
        {nil, at_ms}
    end
  end

  defp carry_out(robots, id, {:cut, ms}) do
    :ok = Emulator.unplug(robots.bases[id])
    # In this millisecond it may have heard something before.
    at_ms = now_ms() + 1
    pass(ms)
    :ok = Emulator.plug(robots.bases[id])
    {nil, at_ms}
  end

  defp carry_out(robots, id, :kill_drive) do
    Vm.call(robots.vm, __MODULE__, :kill_drive, [id])
    {nil, now_ms() + @late_ms}
  end

  defp carry_out(robots, id, person) do
    answer = persist(robots, command(id, person), now_ms() + @patience_ms)
    {answer, now_ms() + @late_ms}
  end

  # A line that has just been lost is open again, and the base heard, a moment later.
  defp persist(robots, {command, arguments} = request, until_ms) do
    answer = swarm(robots, command, arguments)

    if now_ms() < until_ms and not_yet?(answer) do
      pass(50)
      persist(robots, request, until_ms)
    else
      answer
    end
  end

  defp not_yet?({:error, line}),
    do: line =~ ~r/has not reported|offline|not open yet|is not back|starting again/

  defp not_yet?(_answer), do: false

  defp command(id, :drive), do: {:tell, [id, Enum.random(["wander", "goto:3:0", "goto:-3:1"])]}
  defp command(_id, all) when all in [:estop, :reset], do: {all, []}
  defp command(id, command), do: {command, [id]}

  defp frozen_or_gone?(program) do
    case File.read("/proc/#{program}/stat") do
      {:ok, stat} -> stat =~ ") T "
      {:error, _gone} -> true
    end
  end

  @doc "In the VM: ends the process of a robot's drive, as nothing can stop it."
  def kill_drive(id) do
    with pid when is_pid(pid) <- Names.whereis(id, :drive), do: Process.exit(pid, :kill)
  end
end
