defmodule Lab.RadioServer do
  @moduledoc false
  # Runs two radios for simulated robots, as transports of `Swarm.Comms`: one that counts and delivers at once, and one
  # that loses, duplicates and delays messages by `Sim.Radio`.
  use GenServer
  alias Lab.Messages
  alias Robot.Names
  alias Sim.Radio
  alias Swarm.Comms
  alias Swarm.Transport

  @poll_ms 5

  @typedoc "The counter of sent messages, for the radio that never loses any."
  @type counter :: :counters.counters_ref()

  @doc """
  The part of a fleet's supervision tree that loses, duplicates and delays messages as these options say (`Lab.Trial.Setup.new/1`), or a
  script and cuts (`changes?`); none if the messages are to go as fast as they can.
  """
  @spec parts(map(), changes? :: boolean()) :: [Supervisor.child_spec()]
  def parts(options, changes? \\ false) do
    radio = options |> Map.take([:seed, :loss, :duplicates, :delay_ms]) |> Map.to_list()

    if changes? or Radio.new(radio) != Radio.new(seed: options.seed),
      do: [%{id: __MODULE__, start: {__MODULE__, :start_link, [radio]}}],
      else: []
  end

  @doc """
  The transport of that part, or without it the one that loses nothing, and the counter of its
  messages. A `listener` gets `{:sent, from, to, message}` for each that `Lab.Messages` keeps.
  """
  @spec radio(pid() | nil, listener :: pid() | nil) ::
          {{module(), atom(), list()}, pid() | counter()}
  def radio(air, listener \\ nil)
  def radio(nil, listener), do: clear(listener)
  def radio(air, listener), do: {{__MODULE__, :transmit, [air, listener]}, air}

  @doc "The transport that never loses, and its counter."
  @spec clear(listener :: pid() | nil) :: {{module(), atom(), list()}, counter()}
  def clear(listener \\ nil) do
    counter = :counters.new(1, [:write_concurrency])
    {{__MODULE__, :hand_on, [counter, listener]}, counter}
  end

  @doc false
  @spec hand_on(counter(), pid() | nil, atom(), :all | [atom()], Swarm.Message.t()) :: :ok
  def hand_on(counter, listener, from, to, message) do
    tell(listener, from, to, message)
    :counters.add(counter, 1, length(addressed(from, to)))
    Transport.transmit(from, to, message)
  end

  @doc "Starts a radio that loses, duplicates and delays messages; options as in `Sim.Radio.new/1`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options), do: GenServer.start_link(__MODULE__, Radio.new(options))

  @doc false
  @spec transmit(pid(), pid() | nil, atom(), :all | [atom()], Swarm.Message.t()) :: :ok
  def transmit(air, listener, from, to, message) do
    tell(listener, from, to, message)
    GenServer.cast(air, {:transmit, from, addressed(from, to), message})
  end

  defp tell(nil, _from, _to, _message), do: :ok

  defp tell(listener, from, to, message) do
    if Messages.told?(message), do: send(listener, {:sent, from, to, message})
    :ok
  end

  # Each copy is counted, and lost, separately.
  defp addressed(from, :all), do: List.delete(Transport.robots(), from)
  defp addressed(_from, ids), do: ids

  @doc "Cuts exactly these ways from now on (`Sim.Radio.cut_ways/2`), or loses this share."
  @spec change(pid(), {:cut_ways, [{atom(), atom()}]} | {:lose, number()}) :: :ok
  def change(air, change), do: GenServer.cast(air, {:change, change})

  @doc "How many messages were sent and lost so far, by either radio."
  @spec counts(pid() | counter()) :: %{sent: non_neg_integer(), lost: non_neg_integer()}
  def counts(air) when is_pid(air), do: GenServer.call(air, :counts)
  def counts(counter), do: %{sent: :counters.get(counter, 1), lost: 0}

  @impl GenServer
  def init(radio), do: {:ok, %{radio: radio, polling?: false}}

  @impl GenServer
  def handle_cast({:transmit, from, to, message}, s),
    do: {:noreply, poll(%{s | radio: Radio.send(s.radio, Hal.Clock.now_ms(), from, to, message)})}

  def handle_cast({:change, {:cut_ways, ways}}, s),
    do: {:noreply, %{s | radio: Radio.cut_ways(s.radio, ways)}}

  def handle_cast({:change, {:lose, share}}, s),
    do: {:noreply, %{s | radio: Radio.lose(s.radio, share)}}

  @impl GenServer
  def handle_call(:counts, _from, s), do: {:reply, Map.take(s.radio, [:sent, :lost]), s}

  @impl GenServer
  def handle_info(:poll, s) do
    {letters, radio} = Radio.receive(s.radio, Hal.Clock.now_ms())
    for {to, _from, message} <- letters, do: deliver(to, message)
    {:noreply, poll(%{s | radio: radio, polling?: false})}
  end

  defp poll(%{polling?: true} = s), do: s

  defp poll(s) do
    if Radio.empty?(s.radio) do
      s
    else
      Process.send_after(self(), :poll, @poll_ms)
      %{s | polling?: true}
    end
  end

  # One by one: what one robot misses, another may hear. Its first heartbeats tell where a robot
  # is; until then messages to it go to all robots.
  defp deliver(to, %{kind: kind} = message) do
    cond do
      Names.whereis(to, :comms) -> Comms.hear(to, message)
      Mesh.heard?(to) -> Mesh.speak([to], message)
      kind == :heartbeat -> Mesh.speak(:all, message)
      true -> :ok
    end
  end
end
