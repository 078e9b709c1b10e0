defmodule Mesh.Protocol.Packet.ReplayProtection do
  @moduledoc false
  # Decides which datagrams are believed: a signature proves that a datagram was made by the fleet,
  # this module that it was made now, and is heard for the first time. Pure.
  #
  # Every node draws a random session number at its start. A listener accepts a session only by an
  # answer to a challenge of its own (`Mesh.Protocol.Challenge`), which no recording can contain,
  # and which tells it how the clock of that session stands. From then on each datagram of the
  # session must be fresh by that clock (`Mesh.Protocol.ClockOffset`): one that was recorded and
  # never received is worthless 2 s later. And each counts once
  # (`Mesh.Protocol.Packet.SequenceWindow`). If nothing of a session was believed for longer than
  # datagrams are fresh, its window begins anew: whatever it keeps out is stale by now, and a number
  # far too high, which an owner of the fleet's key invented, does not shut the session out for
  # good.
  #
  # A session that was followed by another is never accepted again. While a node is heard, no other
  # session of its name is admitted, so two nodes of the same name do not take turns.
  alias Mesh.Protocol.{Challenge, ClockOffset}
  alias Mesh.Protocol.Packet.SequenceWindow

  @alive_ms 2_000
  @most_retired 64
  @per_second 2_000

  @enforce_keys [:session]
  defstruct @enforce_keys ++ [senders: %{}]

  @typep sender :: %{
           session: non_neg_integer() | nil,
           clock: ClockOffset.t() | nil,
           window: SequenceWindow.t() | nil,
           heard_ms: integer(),
           retired: [non_neg_integer()],
           second: integer(),
           count: non_neg_integer()
         }
  @type t :: %__MODULE__{session: non_neg_integer(), senders: %{String.t() => sender()}}
  @typedoc "What is looked at of a datagram (`Mesh.Protocol.Packet`)."
  @type stamp :: %{
          required(:sender) => String.t(),
          required(:session) => non_neg_integer(),
          required(:sequence) => non_neg_integer(),
          required(:time_ms) => integer(),
          optional(atom()) => term()
        }
  @type refusal :: :stranger | :stale | :doubled | :replayed | :too_fast

  @doc "The state of a node with this session; no node is admitted yet."
  @spec new(session :: non_neg_integer()) :: t()
  def new(session), do: %__MODULE__{session: session}

  @doc """
  Judges a datagram of a known name. `echo` is the challenge that it answers, if it answers one.
  A `:stranger`, and the sender of what is `:stale`, should be challenged: of the first the session is
  not known, of the second perhaps the clock has changed.

      iex> alias Mesh.Protocol.Packet.ReplayProtection
      iex> stamp = fn sequence, time_ms -> %{sender: "min1@lab", session: 99, sequence: sequence, time_ms: time_ms} end
      iex> replay = ReplayProtection.new(7)
      iex> {:error, :stranger, replay} = ReplayProtection.admit(replay, stamp.(1, 5_000), nil, 0)
      iex> {:ok, replay} = ReplayProtection.admit(replay, stamp.(2, 5_010), {7, 0}, 20)
      iex> {:ok, replay} = ReplayProtection.admit(replay, stamp.(3, 5_020), nil, 30)
      iex> {:error, :doubled, replay} = ReplayProtection.admit(replay, stamp.(3, 5_020), nil, 40)
      iex> {:error, :stale, _guard} = ReplayProtection.admit(replay, stamp.(4, 5_040), nil, 3_000)
  """
  @spec admit(t(), stamp(), Challenge.echo() | nil, integer()) ::
          {:ok, t()} | {:error, refusal(), t()}
  def admit(%__MODULE__{} = replay, stamp, echo, now_ms) do
    %{sender: name, session: session} = stamp
    sender = Map.get(replay.senders, name) || stranger(now_ms)
    measured = measure(replay, stamp, echo, now_ms)

    cond do
      sender.session == session -> known(replay, stamp, sender, measured, now_ms)
      session in sender.retired -> {:error, :replayed, replay}
      measured == :error -> {:error, :stranger, replay}
      alive?(sender, now_ms) -> {:error, :stranger, replay}
      true -> known(replay, stamp, begin(sender, stamp, now_ms), measured, now_ms)
    end
  end

  @doc """
  Judges a datagram that is taken however old it is: of an accepted session, for the first time. It
  does not show that its sender is there.
  """
  @spec admit_late(t(), stamp(), integer()) :: {:ok, t()} | {:error, refusal(), t()}
  def admit_late(replay, %{sender: name, session: session} = stamp, now_ms) do
    case replay.senders do
      %{^name => %{session: ^session, heard_ms: heard_ms} = sender} ->
        with {:ok, replay} <- counted(replay, stamp, sender, now_ms),
             do: {:ok, put_in(replay.senders[name].heard_ms, heard_ms)}

      _unknown ->
        {:error, :stranger, replay}
    end
  end

  @doc """
  Whether a datagram is a copy of one that was admitted, as far as that is known without reading
  it. Most are, because what arrives by multicast arrives by address, too.
  """
  @spec copy?(t(), String.t(), non_neg_integer(), non_neg_integer()) :: boolean()
  def copy?(replay, name, session, sequence) do
    case replay.senders do
      # What is behind the window is judged by its time.
      %{^name => %{session: ^session, window: window}} ->
        SequenceWindow.seen?(window, sequence) and not SequenceWindow.behind?(window, sequence)

      _other ->
        false
    end
  end

  @doc "The accepted session of this name now, or `nil`."
  @spec session(t(), String.t()) :: non_neg_integer() | nil
  def session(replay, name) do
    case replay.senders do
      %{^name => %{session: session}} -> session
      _unknown -> nil
    end
  end

  @doc "Whether it is time to challenge this node again: what is known of its clock has grown old."
  @spec due?(t(), String.t(), integer()) :: boolean()
  def due?(replay, name, now_ms) do
    case replay.senders do
      %{^name => %{clock: clock}} -> ClockOffset.due?(clock, now_ms)
      _unknown -> false
    end
  end

  defp stranger(now_ms) do
    %{
      session: nil,
      clock: nil,
      window: nil,
      heard_ms: now_ms - @alive_ms,
      retired: [],
      second: 0,
      count: 0
    }
  end

  # Only an answer to this life of this node counts.
  defp measure(%{session: own}, stamp, {own, asked_ms}, now_ms),
    do: ClockOffset.measure(asked_ms, stamp.time_ms, now_ms)

  defp measure(_guard, _stamp, _none, _now_ms), do: :error

  defp alive?(%{session: nil}, _now_ms), do: false
  defp alive?(%{heard_ms: heard_ms}, now_ms), do: now_ms - heard_ms < @alive_ms

  defp begin(sender, %{session: session, sequence: sequence}, now_ms) do
    retired = Enum.take(List.wrap(sender.session) ++ sender.retired, @most_retired)

    window = SequenceWindow.new(sequence)
    %{stranger(now_ms) | session: session, retired: retired, window: window}
  end

  # An answer is fresh by itself. The newest measurement is the right one: after a computer was
  # suspended, older ones are wrong.
  defp known(replay, stamp, sender, {:ok, clock}, now_ms),
    do: counted(replay, stamp, anew(%{sender | clock: clock}, stamp, now_ms), now_ms)

  defp known(replay, stamp, sender, :error, now_ms) do
    if ClockOffset.fresh?(sender.clock, stamp.time_ms, now_ms),
      do: counted(replay, stamp, anew(sender, stamp, now_ms), now_ms),
      else: {:error, :stale, replay}
  end

  defp anew(%{heard_ms: heard_ms} = sender, %{sequence: sequence}, now_ms)
       when now_ms - heard_ms > @alive_ms,
       do: %{sender | window: SequenceWindow.new(sequence)}

  defp anew(sender, _stamp, _now_ms), do: sender

  defp counted(replay, %{sender: name, sequence: sequence}, sender, now_ms) do
    second = div(now_ms, 1_000)
    count = if second == sender.second, do: sender.count + 1, else: 1

    with true <- count <= @per_second || :too_fast,
         {:ok, window} <- SequenceWindow.take(sender.window, sequence) do
      sender = %{sender | window: window, heard_ms: now_ms, second: second, count: count}
      {:ok, %{replay | senders: Map.put(replay.senders, name, sender)}}
    else
      reason -> {:error, reason, replay}
    end
  end
end
