defmodule Tools.Replay.Live do
  @moduledoc false
  # Shows a recording as a fleet that the page can watch (`Console.Live`): at a pace, from any time, forwards and backwards.
  #
  # A replay itself goes forwards only, and decides again what the robots decided. So beside the place that is shown a scout
  # goes through all of the recording once, in small parts, so that no browser waits for it: it leaves the states from which
  # the cursor goes on (`Lab.Replay.Cursor`), notes the run for the strip of time, and finds what differs. Nothing is shown that the
  # scout has not reached.
  use GenServer
  alias Console.{About, Pace}
  alias Console.Cli.Format
  alias Hal.Clock
  alias Lab.Messages
  alias Lab.Replay.{Cursor, Kind}
  alias Sim.Scene
  alias Tools.Replay.{Command, Guard, Moment, Options, Recording, Verdict}
  @behaviour Console.Live

  # From one note of the run to the next.
  @note_ms 500
  # The scout rests after so long, so that questions are answered.
  @part_ms 40
  @wait_ms 50
  # Of so long before the time that is shown messages are told.
  @said_ms 20_000

  @enforce_keys [:recording, :names, :runs, :last_ms, :tracks, :due_ms]
  defstruct @enforce_keys ++
              [
                pace: Pace.new(),
                history: [],
                noted: 0,
                told: 0,
                differs?: false,
                tick: 0,
                about: nil,
                messages: nil
              ]

  @typedoc """
  `tracks` are the recording and, with `--against`, the one beside it: each with the cursor of its scout and the place that is
  shown. `history` is what `history/2` tells, newest first, and `noted` their count.
  """
  @type t :: %__MODULE__{}

  @doc "The start, paused at this time; `parts` is where two recordings part, and in what: ms and a line."
  @spec new(
          [Recording.t(), ...],
          at_ms :: non_neg_integer(),
          parts :: {integer(), String.t()} | nil
        ) ::
          t()
  def new([recording | _] = recordings, at_ms, parts) do
    tracks = Enum.map(recordings, &track/1)
    {:ok, paused} = Pace.command(Pace.new(), :pause)

    %__MODULE__{
      recording: recording,
      names: Recording.names(recording),
      runs: Enum.map(recordings, &Path.basename(&1.file.path)),
      last_ms: recordings |> Enum.map(&Recording.last_ms/1) |> Enum.max(),
      tracks: tracks,
      due_ms: Clock.now_ms(),
      pace: paused
    }
    |> note(tracks |> hd() |> shown())
    |> mark(parts)
    |> seek(at_ms)
  end

  defp track(recording) do
    scout = Cursor.new(Recording.replay(recording, nil), &Recording.ticks(recording, &1))
    %{scout: scout, here: scout.here, wanted_ms: 0}
  end

  defp mark(state, nil), do: state

  defp mark(state, {at_ms, line}) do
    part = %{at_s: at_ms / 1000, stage: :parts, line: line, robot: nil}
    %{state | history: [%{stages: [part]} | state.history], noted: state.noted + 1}
  end

  @doc "Goes on until it is stopped; returns whether something differed from the recording, or was not compared."
  @spec loop(t()) :: differs? :: boolean()
  def loop(state) do
    send(self(), :scout)
    :gen_server.enter_loop(__MODULE__, [], state)
  catch
    :exit, {:shutdown, {:closed, differs?}} -> differs?
    :exit, {%{__exception__: true} = error, stack} -> reraise error, stack
    :exit, {reason, stack} when is_list(stack) -> :erlang.raise(:error, reason, stack)
  end

  @doc "Ends it."
  @spec close(pid()) :: :ok
  def close(live), do: GenServer.cast(live, :close)

  @impl Console.Live
  def scene(live), do: GenServer.call(live, :scene, :infinity)

  @impl Console.Live
  def beside(live), do: GenServer.call(live, :beside, :infinity)

  @impl Console.Live
  def pace(live), do: GenServer.call(live, :pace, :infinity)

  @impl Console.Live
  def answer(live, text), do: GenServer.call(live, {:answer, text}, :infinity)

  @impl Console.Live
  def history(live, after_count), do: GenServer.call(live, {:history, after_count}, :infinity)

  @impl Console.Live
  def messages(live), do: {:ok, GenServer.call(live, :messages, :infinity)}

  @impl Console.Live
  def nodes(_live), do: {:error, "a recording says nothing of nodes and programs"}

  @impl Console.Live
  def about(live, robot), do: GenServer.call(live, {:about, robot}, :infinity)

  @impl Console.Live
  def command(_live, _command),
    do: {:error, "this is a recording: nothing in it can be told anything, or be stopped"}

  @impl Console.Live
  def offers(_live), do: [:replay]

  @impl Console.Live
  def notice(_live), do: nil

  @impl Console.Live
  def lines(_live), do: []

  @impl Console.Live
  def ended(_live), do: nil

  @impl Console.Live
  def result(_live), do: %{}

  @impl Console.Live
  def stop(live), do: close(live)

  @impl GenServer
  def init(state), do: {:ok, state}

  @impl GenServer
  def handle_cast(:close, state), do: {:stop, {:shutdown, {:closed, state.differs?}}, state}

  @impl GenServer
  def handle_call(question, _from, state) do
    # Whatever a browser asks is no work on a tick of the recording.
    Guard.passed()
    {answer, state} = reply(question, state)
    {:reply, answer, state}
  end

  defp reply(:scene, state), do: {state.tracks |> hd() |> shown(), state}

  defp reply(:beside, %{tracks: [_one]} = state), do: {nil, state}
  defp reply(:beside, %{tracks: [_one, other]} = state), do: {shown(other), state}

  defp reply(:pace, state), do: {state.pace, state}

  defp reply({:history, after_count}, state) do
    entries = state.history |> Enum.take(max(state.noted - after_count, 0)) |> Enum.reverse()

    {%{
       last_s: state.last_ms / 1000,
       known_s: known_ms(state) / 1000,
       playing: state.pace.left != 0,
       names: state.runs,
       count: state.noted,
       entries: entries
     }, state}
  end

  defp reply({:about, robot}, %{about: {number, robot, about}} = state) when number != nil do
    if number == here(state).number,
      do: {about, state},
      else: reply({:about, robot}, %{state | about: nil})
  end

  defp reply({:about, robot}, state) do
    here = here(state)
    about = Map.put(about_of(here.replay, robot), :why, why("#{robot}", here, state))
    {about, %{state | about: {here.number, robot, about}}}
  end

  # Of one place the same for all that look.
  defp reply(:messages, state) do
    here = here(state)

    case state.messages do
      {number, messages} when number == here.number -> {messages, state}
      _elsewhere -> said(here, state)
    end
  end

  defp reply({:answer, text}, state) do
    case word(text, state) do
      {:ok, said, state} -> {{:ok, said}, state}
      {:error, line} -> {{:error, line}, state}
    end
  end

  defp said(here, state) do
    to_ms = Kind.at_ms(here.replay)

    messages =
      state.recording
      |> Recording.ticks(max(to_ms - @said_ms, 0))
      |> Stream.take_while(fn {at_ms, _entries} -> at_ms <= to_ms end)
      |> Enum.reduce(%Messages{}, fn {at_ms, _entries} = tick, messages ->
        Messages.note(messages, at_ms, Kind.messages(here.replay, tick))
      end)
      |> Messages.list()

    {messages, %{state | messages: {here.number, messages}}}
  end

  # Only a run in lockstep has members; of robots of processes their reasons are known.
  defp about_of(%Lab.Replay{} = replay, robot) do
    with %Swarm.Member{} = member <- Lab.Trial.robot(Lab.Replay.trial(replay), robot),
         %{} = about <- About.of_member(member),
         do: about,
         else: (_dead_or_nothing_yet -> About.nothing())
  end

  defp about_of(%Lab.Replay.Robots{} = replay, robot),
    do: About.with_layer(About.nothing(), {:ok, Lab.Replay.Robots.layer(replay, robot)})

  defp why(name, here, state), do: Moment.lines(%Options{why: name}, here, state.names)

  # What a person types or clicks.
  defp word(text, state) do
    case String.split(text) do
      [word] when word in ["pause", "resume"] -> paced(state, String.to_existing_atom(word))
      ["play"] -> paced(state, :resume)
      ["speed", number] -> with {:ok, speed} <- speed(number), do: paced(state, {:speed, speed})
      [word | _] when word in ["estop", "stop", "halt"] -> command(self(), :estop)
      _line -> typed(Command.parse(text, state.names, state.last_ms / 1000), state)
    end
  end

  defp speed(text) do
    with {:error, allowed} <- Pace.speed(text),
         do: {:error, "speed: expected #{allowed} got #{inspect(text)}"}
  end

  defp paced(state, command) do
    with {:ok, pace} <- Pace.command(state.pace, command) do
      state = schedule(%{state | pace: pace}, Clock.now_ms())
      {:ok, Pace.words(pace), state}
    end
  end

  defp typed({:ok, {:step, count}}, state) do
    to_ms = Kind.at_ms(here(state).replay) + 100 * count
    at(seek(pause(state), min(max(to_ms, 0), state.last_ms)))
  end

  defp typed({:ok, {:goto, to_ms}}, state), do: at(seek(state, to_ms))
  defp typed({:ok, :next}, state), do: event(state, &Enum.min/2, &(&1 > &2))
  defp typed({:ok, :previous}, state), do: event(state, &Enum.max/2, &(&1 < &2))

  defp typed({:ok, {:show, name}}, state) do
    options = %Options{at_s: Kind.at_ms(here(state).replay) / 1000, robot: name}
    {:ok, Moment.lines(options, here(state), state.names), state}
  end

  defp typed({:ok, {:why, name}}, state),
    do: {:ok, why(name || "leader", here(state), state), state}

  defp typed({:ok, :help}, state) do
    pace = "pause, play, speed 2   let it stand, or go on, at a multiple of its own time"
    {:ok, [pace | Command.help()], state}
  end

  defp typed({:ok, :again}, _state), do: {:error, "type a command; help lists them"}

  defp typed({:ok, :quit}, _state),
    do: {:error, "the page is closed in the browser, its program in the terminal"}

  defp typed({:error, line}, _state), do: {:error, line}

  defp event(state, choose, beyond?) do
    now_ms = Kind.at_ms(here(state).replay)

    times =
      for entry <- state.history,
          %{at_s: at_s} <- entry.stages,
          at_ms = at_ms(at_s),
          beyond?.(at_ms, now_ms),
          do: at_ms

    case choose.(times, fn -> nil end) do
      nil -> {:error, "no event of the fleet is known there"}
      to_ms -> at(seek(pause(state), to_ms))
    end
  end

  # The end of the tick that begins with it, or in which it was: then it shows.
  defp at_ms(at_s), do: 100 * (floor(10 * at_s + 1.0e-6) + 1)

  defp pause(%{pace: %{left: 0}} = state), do: state

  defp pause(state) do
    {:ok, pace} = Pace.command(state.pace, :pause)
    %{state | pace: pace, tick: state.tick + 1}
  end

  defp at(state) do
    here = here(state)
    wanted_ms = hd(state.tracks).wanted_ms
    at_ms = Kind.at_ms(here.replay)

    more =
      if wanted_ms > known_ms(state),
        do: ["it is read up to #{Format.seconds(known_ms(state))} so far; the rest follows"],
        else: []

    {:ok, Enum.join([Format.seconds(at_ms) | more], ": "), state}
  end

  @impl GenServer
  def handle_info(:scout, state) do
    deadline_ms = Clock.now_ms() + @part_ms
    state = scout(state, deadline_ms)
    unless ended?(state), do: send(self(), :scout)
    {:noreply, state}
  end

  def handle_info({:play, tick}, %{tick: tick} = state) do
    now_ms = Kind.at_ms(here(state).replay)

    cond do
      now_ms >= state.last_ms or (ended?(state) and now_ms >= known_ms(state)) ->
        {:noreply, pause(state)}

      now_ms >= known_ms(state) ->
        _timer = Process.send_after(self(), {:play, tick}, @wait_ms)
        {:noreply, state}

      true ->
        state = seek(state, now_ms + 100)
        pace = Pace.stepped(state.pace, Clock.now_ms())
        {:noreply, schedule(%{state | pace: pace}, state.due_ms)}
    end
  end

  def handle_info({:play, _former}, state), do: {:noreply, state}

  defp schedule(%{tick: tick} = state, last_ms) do
    case Pace.wait_ms(state.pace) do
      :never ->
        %{state | tick: tick + 1}

      wait_ms ->
        due_ms = max(last_ms + wait_ms, Clock.now_ms())
        _timer = Process.send_after(self(), {:play, tick + 1}, due_ms, abs: true)
        %{state | tick: tick + 1, due_ms: due_ms}
    end
  end

  defp scout(state, deadline_ms) do
    {track, index} =
      state.tracks
      |> Enum.with_index()
      |> Enum.min_by(fn {%{scout: scout}, _index} -> {scout.here.end?, Cursor.at_ms(scout)} end)

    if track.scout.here.end? do
      state
    else
      next_ms = (div(Cursor.at_ms(track.scout), @note_ms) + 1) * @note_ms
      late? = fn -> Clock.now_ms() >= deadline_ms end
      {scout, found} = Cursor.until(track.scout, &(Kind.at_ms(&1) >= next_ms or late?.()))
      state = %{state | tracks: List.replace_at(state.tracks, index, %{track | scout: scout})}
      state = %{state | differs?: state.differs? or found != [] or gaps?(scout)}
      noted? = index == 0 and (Cursor.at_ms(scout) >= next_ms or scout.here.end?)
      state = if noted?, do: note(state, Kind.scene(scout.here.replay)), else: state
      state = seek(state, hd(state.tracks).wanted_ms)
      if late?.(), do: state, else: scout(state, deadline_ms)
    end
  end

  defp gaps?(%{here: %{end?: true, replay: replay}}), do: Verdict.gaps?(Kind.compared(replay))
  defp gaps?(_under_way), do: false

  # All tracks at one time, as far as it is known.
  defp seek(state, to_ms), do: %{state | tracks: Enum.map(state.tracks, &seek_track(&1, to_ms))}

  defp seek_track(%{scout: scout, here: here} = track, to_ms) do
    at_ms = min(to_ms, Cursor.at_ms(scout))
    track = %{track | wanted_ms: to_ms}

    if Kind.at_ms(here.replay) == at_ms do
      track
    else
      {cursor, _told_by_the_scout} = Cursor.goto(%{scout | here: here}, at_ms)
      %{track | here: cursor.here}
    end
  end

  defp note(state, scene) do
    entry = %{
      at_s: scene.at_ms / 1000,
      error: scene.error && Tuple.to_list(scene.error),
      leader: scene.leader,
      formed: scene.formed?,
      held: scene.estop != nil,
      stages: Scene.news(scene.stages, state.told)
    }

    %{
      state
      | history: [entry | state.history],
        noted: state.noted + 1,
        told: Scene.told(scene.stages)
    }
  end

  defp here(state), do: hd(state.tracks).here
  defp shown(track), do: Kind.scene(track.here.replay)
  defp known_ms(state), do: Cursor.at_ms(hd(state.tracks).scout)
  defp ended?(state), do: Enum.all?(state.tracks, & &1.scout.here.end?)
end
