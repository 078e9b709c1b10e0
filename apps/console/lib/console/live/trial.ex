defmodule Console.Live.Trial do
  @moduledoc """
  Runs a trial that a person watches: the lockstep run, at the pace that the person wants (`Console.Pace`), at
  first one step of 100 ms each 100 ms.

  It never runs faster to make up for lost time: on a machine too slow for its fleet the run is
  slow, and an answer may take as long as a step. Whatever the pace, the same commands at the same
  steps give the same run.
  """
  use GenServer
  alias Console.Cli.Format
  alias Console.Pace
  alias Console.About
  alias Console.Prompt
  alias Lab.{Messages, Recorder, Trial}
  alias Swarm.Commands
  alias Swarm.MissionRegistry.Text
  @behaviour Console.Live

  @done {:ok, "done"}
  # Of what happens in a run that a person may leave on.
  @kept 1_000

  @doc "Starts the run of a new trial; the error says in one line what is wrong with its options."
  @spec start_link(module(), map(), Pace.t()) :: {:ok, pid()} | {:error, String.t()}
  def start_link(module, options, pace \\ Pace.new()) do
    with {:ok, setup} <- module.setup(options) do
      trial = module.begin(setup, record: true, keep: @kept)
      GenServer.start_link(__MODULE__, {module, trial, pace, nil})
    end
  end

  @doc """
  Starts the run with this start, which a recorder records step by step (`Lab.Recorder`), with so
  many pictures a second of each robot (`nil`: none).
  """
  @spec start_recorded(Lab.Trial.Setup.t(), Pace.t(), recorder :: pid(), number() | nil) ::
          {:ok, pid()}
  def start_recorded(setup, pace, recorder, pictures \\ nil) do
    trial = Trial.begin(setup, record: true, keep: @kept)
    GenServer.start_link(__MODULE__, {Trial, trial, pace, {recorder, pictures}})
  end

  @impl Console.Live
  def scene(live), do: GenServer.call(live, :scene, :infinity)

  @impl Console.Live
  def command(_live, {:program, _robot, _what, _name}), do: no_nodes()

  def command(live, command) do
    given_us = Swarm.Commands.Client.given_us()
    GenServer.call(live, {:command, command, given_us}, :infinity)
  end

  # In lockstep nothing can be killed from outside.
  @impl Console.Live
  def ended(_live), do: nil

  @impl Console.Live
  def pace(live), do: GenServer.call(live, :pace, :infinity)

  @impl Console.Live
  def result(live), do: GenServer.call(live, :result, :infinity)

  @impl Console.Live
  def lines(_live), do: ["all robots live in process #{System.pid()}, in lockstep; see --nodes"]

  @impl Console.Live
  def stop(live), do: GenServer.stop(live)

  @impl Console.Live
  def offers(_live), do: [:kill, :landmark, :place]

  @impl Console.Live
  def notice(_live), do: nil

  @impl Console.Live
  def status(live, :all), do: live |> scene() |> Format.everybody()
  def status(live, robot), do: live |> scene() |> Format.one(robot)

  @impl Console.Live
  def about(live, robot), do: GenServer.call(live, {:about, robot}, :infinity)

  @impl Console.Live
  def messages(live), do: {:ok, Messages.list(GenServer.call(live, :messages, :infinity))}

  @impl Console.Live
  def nodes(_live), do: no_nodes()

  defp no_nodes,
    do:
      {:error,
       "robots in lockstep are no processes, and run no programs; those of a live demo do"}

  @impl GenServer
  def init({module, trial, pace, recorder}) do
    Lab.Trial.Memory.prepare()
    # Steps that were ordered at another pace are not made: theirs is another tick.
    s = %{
      module: module,
      trial: trial,
      pace: pace,
      recorder: recorder,
      tick: 0,
      due_ms: Hal.Clock.now_ms(),
      stopped_us: nil,
      messages: %Messages{}
    }

    {:ok, schedule(s, s.due_ms)}
  end

  @impl GenServer
  def handle_call(:scene, _from, state), do: {:reply, state.module.scene(state.trial), state}

  def handle_call({:about, robot}, _from, state) do
    member = state.module.robot(state.trial, robot)
    {:reply, member && About.of_member(member), state}
  end

  def handle_call(:result, _from, state), do: {:reply, state.module.result(state.trial), state}

  def handle_call(:messages, _from, state), do: {:reply, state.messages, state}
  def handle_call(:pace, _from, state), do: {:reply, state.pace, state}

  def handle_call({:command, {:pace, command}, _given_us}, _from, state) do
    case Pace.command(state.pace, command) do
      {:ok, pace} ->
        {:reply, {:ok, Pace.words(pace)}, schedule(%{state | pace: pace}, Hal.Clock.now_ms())}

      {:error, line} ->
        {:reply, {:error, line}, state}
    end
  end

  # As robots of their own do it, a run refuses what was ordered before it was stopped.
  def handle_call({:command, command, given_us}, _from, state) do
    stop? = Prompt.kind(command) == :stop

    with true <- stop? or state.stopped_us == nil or given_us >= state.stopped_us,
         {%_struct{} = trial, said} <- carry_out(command, state) do
      stopped_us = if stop?, do: System.monotonic_time(:microsecond), else: state.stopped_us
      state = %{state | trial: trial, stopped_us: stopped_us}
      {:reply, said, %{state | messages: written(state, command, said)}}
    else
      false ->
        {:reply, {:error, "they were stopped after this command was given; repeat it"}, state}

      {:error, line} ->
        {:reply, {:error, line}, state}
    end
  end

  @impl GenServer
  def handle_info({:step, tick}, %{tick: tick} = state) do
    stepped = state.module.step(state.trial)
    messages = Messages.note(state.messages, stepped.at_ms, sent(stepped))
    trial = record(state.recorder, state.trial, stepped)
    pace = Pace.stepped(state.pace, Hal.Clock.now_ms())
    state = %{state | trial: trial, messages: messages, pace: pace}
    {:noreply, schedule(state, state.due_ms)}
  end

  def handle_info({:step, _former}, state), do: {:noreply, state}

  defp written(state, {:tell, to, {:send, text}}, {:ok, _accepted}),
    do: Messages.person(state.messages, state.module.scene(state.trial).at_ms, to, text)

  defp written(state, _command, _said), do: state.messages

  defp sent(%Trial{entries: entries}), do: entries |> Enum.reverse() |> Messages.of_entries()
  defp sent(_stand_in), do: []

  defp record(nil, _before, %Trial{} = trial), do: trial |> Trial.take_entries() |> elem(1)
  defp record(nil, _before, trial), do: trial

  defp record({recorder, pictures}, before, trial),
    do: Recorder.step(recorder, before, trial, pictures)

  # A message for each step, so that commands come between two of them, however fast it goes.
  defp schedule(%{tick: tick} = state, last_ms) do
    case Pace.wait_ms(state.pace) do
      :never ->
        %{state | tick: tick + 1}

      wait_ms ->
        due_ms = max(last_ms + wait_ms, Hal.Clock.now_ms())
        _timer = Process.send_after(self(), {:step, tick + 1}, due_ms, abs: true)
        %{state | tick: tick + 1, due_ms: due_ms}
    end
  end

  defp carry_out({:kill, :leader}, %{module: module, trial: trial}) do
    case module.scene(trial).leader do
      nil -> {:error, "there is no leader to kill yet"}
      leader -> {module.kill(trial, leader), @done}
    end
  end

  defp carry_out({:kill, robot}, %{module: module, trial: trial}) do
    if robot in module.living(trial),
      do: {module.kill(trial, robot), @done},
      else: {:error, "#{robot} is already dead"}
  end

  defp carry_out({:landmark, :none}, _state),
    do: {:error, "in lockstep the landmark can be moved, but not removed"}

  defp carry_out({:landmark, place}, %{module: module, trial: trial}),
    do: with({:ok, trial} <- module.move(trial, place), do: {trial, @done})

  defp carry_out({:place, who, place}, %{module: module, trial: trial}),
    do: with({:ok, trial} <- module.place(trial, who, place), do: {trial, @done})

  defp carry_out({:formation, {kind, spacing}}, %{module: module, trial: trial} = state) do
    {_kind, present} = module.scene(trial).formation
    tell(:all, {:formation, kind, spacing || present}, state, &Commands.any_told/2)
  end

  defp carry_out(:reset, state), do: tell(:all, :reset, state)

  # One call for all.
  defp carry_out(:estop, state) do
    at_ms = state.module.scene(state.trial).at_ms
    tell(:all, {:estop, {:demo, 0, at_ms}}, state)
  end

  defp carry_out({:tell, _target, {:replace, _mission}}, _state),
    do: {:error, "in lockstep no mission is replaced; start:MISSION starts another one"}

  defp carry_out({:tell, target, command}, %{module: module, trial: trial} = state) do
    with :ok <- possible(command),
         {:ok, request} <- Text.request(command, length(module.living(trial))),
         do: tell(target, request, state)
  end

  defp possible(command) when command in [:ping, :keep, :arm, :disarm, :acknowledge],
    do:
      {:error,
       "in lockstep robots have no wheels to arm or disarm, answer no ping and keep nothing"}

  defp possible(_command), do: :ok

  defp tell(target, request, %{module: module, trial: trial}, words \\ &Commands.told/2) do
    robots = if target == :all, do: module.living(trial), else: target

    {trial, answers} =
      for to <- if(target == :all, do: [:all], else: target), reduce: {trial, %{}} do
        {trial, answers} ->
          {trial, more} = module.ask(trial, to, request)
          {trial, Map.merge(answers, more)}
      end

    case words.(robots, answers) do
      :ok -> {trial, {:ok, "accepted"}}
      said -> {trial, said}
    end
  end
end
