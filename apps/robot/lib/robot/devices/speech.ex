defmodule Robot.Devices.Speech do
  @moduledoc """
  Says aloud what becomes of a robot, by a program such as Debian's `espeak-ng`: the stages of its mission that its file names,
  and `estop` and `reset` of its gate.

  One sentence at a time: while one is said, only the newest of the others waits. A program that is not there, fails or takes longer
  than 10 s is one line in the log until it works again, and keeps nothing else from anything.
  """
  use GenServer
  require Logger
  alias Hal.Event
  alias Robot.Config.Speech
  alias Robot.Names

  @longest_ms 10_000
  @events [[:robot, :stage], [:robot, :gate, :estop], [:robot, :gate, :reset]]

  @doc "Starts it for a robot with these options."
  @spec start_link({robot :: atom(), keyword()}) :: GenServer.on_start()
  def start_link({robot, options}),
    do: GenServer.start_link(__MODULE__, {robot, options}, name: Names.via(robot, :speech))

  @doc """
  The sentence of an event.

      iex> Robot.Devices.Speech.sentence(:mag1, "cannot_form")
      "mag1: cannot form"
  """
  @spec sentence(robot :: atom(), event :: String.t()) :: String.t()
  def sentence(robot, event), do: "#{robot}: #{String.replace(event, "_", " ")}"

  @impl GenServer
  def init({robot, options}) do
    # So that its handlers are taken away with it.
    Process.flag(:trap_exit, true)

    for event <- @events,
        do:
          :ok =
            Event.attach({__MODULE__, robot, event}, event, &__MODULE__.hear/4, {robot, self()})

    # Its file has checked them; the defaults are added here.
    {:ok, options} = Speech.check(options)
    {:ok, %{robot: robot, options: Map.new(options), port: nil, waiting: nil, failed: nil}}
  end

  @doc false
  @spec hear(Event.name(), map(), map(), {atom(), pid()}) :: :ok
  def hear(name, _measurements, %{robot: robot} = about, {robot, speech}) do
    event = about[:stage] || List.last(name)
    GenServer.cast(speech, {:event, Atom.to_string(event)})
  end

  def hear(_name, _measurements, _of_another, _speech), do: :ok

  @impl GenServer
  def handle_cast({:event, event}, s) do
    if event in s.options.events,
      do: {:noreply, say(%{s | waiting: sentence(s.robot, event)})},
      else: {:noreply, s}
  end

  @impl GenServer
  def handle_info({port, {:exit_status, 0}}, %{port: port} = s),
    do: {:noreply, say(%{s | port: nil, failed: nil})}

  def handle_info({port, {:exit_status, status}}, %{port: port} = s),
    do: {:noreply, say(failed(%{s | port: nil}, "ended with status #{status}"))}

  def handle_info({:late, port}, %{port: port} = s) do
    Port.close(port)
    {:noreply, say(failed(%{s | port: nil}, "takes longer than #{div(@longest_ms, 1_000)} s"))}
  end

  def handle_info(_written_or_late, s), do: {:noreply, s}

  @impl GenServer
  def terminate(_reason, s),
    do: for(event <- @events, do: Event.detach({__MODULE__, s.robot, event}))

  defp say(%{port: nil, waiting: text} = s) when text != nil do
    case System.find_executable(s.options.program) do
      nil -> failed(%{s | waiting: nil}, "is not installed")
      path -> begin(path, %{s | waiting: nil}, text)
    end
  end

  defp say(s), do: s

  defp begin(path, s, text) do
    arguments = ["-v", s.options.voice, "--", text]
    port = Port.open({:spawn_executable, path}, [:binary, :exit_status, args: arguments])
    _timer = Process.send_after(self(), {:late, port}, @longest_ms)
    %{s | port: port}
  end

  # Once, until it works again.
  defp failed(%{failed: why} = s, why), do: s

  defp failed(s, why) do
    Logger.warning("#{s.robot}: nothing is said: #{s.options.program} #{why}")
    %{s | failed: why}
  end
end
