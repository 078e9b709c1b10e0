defmodule Mesh.Protocol.Packet.ReplayProtection do
  @moduledoc """
  Decides which nodes are admitted: a signature proves that a datagram was made by the fleet, this
  module that it was made now. Pure.

  Every node draws a random session number at its start. A listener accepts a session only when a
  beacon of it contains the listener's own session, which an old recording cannot contain. Within
  a session a window of sequence numbers keeps out what was heard before: a datagram counts once,
  and one that is 1,024 behind the newest not at all.

  A session that was followed by another is never accepted again. While a node is heard, no other
  session of its name is admitted, so two nodes of the same name do not take turns.
  """
  import Bitwise

  @width 1_024
  @full (1 <<< @width) - 1
  @alive_ms 2_000
  @most_retired 64
  @per_second 2_000

  @enforce_keys [:session]
  defstruct @enforce_keys ++ [senders: %{}]

  @typep sender :: %{
           session: non_neg_integer() | nil,
           top: non_neg_integer(),
           seen: non_neg_integer(),
           heard_ms: integer(),
           retired: [non_neg_integer()],
           second: integer(),
           count: non_neg_integer()
         }
  @type t :: %__MODULE__{session: non_neg_integer(), senders: %{String.t() => sender()}}
  @type refusal :: :stranger | :doubled | :replayed | :too_fast

  @doc "The state of a node with this session; no node is admitted yet."
  @spec new(session :: non_neg_integer()) :: t()
  def new(session), do: %__MODULE__{session: session}

  @doc """
  Judges a datagram of a known name. `told` is the session of this node according to a beacon,
  `nil` if the beacon has none, and for all datagrams that are not beacons.

      iex> alias Mesh.Protocol.Packet.ReplayProtection
      iex> guard = ReplayProtection.new(7)
      iex> {:error, :stranger, guard} = ReplayProtection.admit(guard, "min1@lab", 99, 1, nil, 0)
      iex> {:ok, guard} = ReplayProtection.admit(guard, "min1@lab", 99, 2, 7, 10)
      iex> {:ok, guard} = ReplayProtection.admit(guard, "min1@lab", 99, 3, nil, 20)
      iex> {:error, :doubled, _guard} = ReplayProtection.admit(guard, "min1@lab", 99, 3, nil, 30)
  """
  @spec admit(
          t(),
          String.t(),
          non_neg_integer(),
          non_neg_integer(),
          non_neg_integer() | nil,
          integer()
        ) :: {:ok, t()} | {:error, refusal(), t()}
  def admit(%__MODULE__{} = guard, name, session, sequence, told, now_ms) do
    sender = Map.get(guard.senders, name) || stranger(now_ms)

    cond do
      sender.session == session -> counted(guard, name, sender, sequence, now_ms)
      told != guard.session -> {:error, :stranger, guard}
      session in sender.retired -> {:error, :replayed, guard}
      alive?(sender, now_ms) -> {:error, :stranger, guard}
      true -> counted(guard, name, begin(sender, session, sequence, now_ms), sequence, now_ms)
    end
  end

  @doc """
  Whether a datagram is a copy of one that was admitted, as far as that is known without reading
  it. Most are, because what arrives by multicast arrives by address, too.
  """
  @spec copy?(t(), String.t(), non_neg_integer(), non_neg_integer()) :: boolean()
  def copy?(guard, name, session, sequence) do
    case guard.senders do
      %{^name => %{session: ^session} = sender} -> window(sender, sequence) == :doubled
      _other -> false
    end
  end

  @doc "The accepted session of this name now, or `nil`."
  @spec session(t(), String.t()) :: non_neg_integer() | nil
  def session(guard, name) do
    case guard.senders do
      %{^name => %{session: session}} -> session
      _unknown -> nil
    end
  end

  @doc "The accepted sessions now, by name."
  @spec sessions(t()) :: %{String.t() => non_neg_integer()}
  def sessions(guard), do: for({name, %{session: s}} <- guard.senders, into: %{}, do: {name, s})

  defp stranger(now_ms) do
    %{
      session: nil,
      top: 0,
      seen: 0,
      heard_ms: now_ms - @alive_ms,
      retired: [],
      second: 0,
      count: 0
    }
  end

  defp alive?(%{session: nil}, _now_ms), do: false
  defp alive?(%{heard_ms: heard_ms}, now_ms), do: now_ms - heard_ms < @alive_ms

  # Everything before the first admitted datagram counts as heard, because some of it was rejected
  # and may have been recorded.
  defp begin(sender, session, sequence, now_ms) do
    retired = Enum.take(List.wrap(sender.session) ++ sender.retired, @most_retired)

    %{stranger(now_ms) | session: session, retired: retired, top: sequence - 1, seen: @full}
  end

  defp counted(guard, name, sender, sequence, now_ms) do
    second = div(now_ms, 1_000)
    count = if second == sender.second, do: sender.count + 1, else: 1

    with true <- count <= @per_second || :too_fast,
         {:ok, sender} <- window(sender, sequence) do
      sender = %{sender | heard_ms: now_ms, second: second, count: count}
      {:ok, %{guard | senders: Map.put(guard.senders, name, sender)}}
    else
      reason -> {:error, reason, guard}
    end
  end

  # Bit k of `seen` stands for the number `top - k`.
  defp window(%{top: top} = sender, sequence) when sequence > top do
    shift = sequence - top
    seen = if shift >= @width, do: 0, else: sender.seen <<< shift &&& @full
    {:ok, %{sender | top: sequence, seen: seen ||| 1}}
  end

  defp window(%{top: top}, sequence) when top - sequence >= @width, do: :doubled

  defp window(%{top: top, seen: seen} = sender, sequence) do
    bit = 1 <<< (top - sequence)
    if (seen &&& bit) == 0, do: {:ok, %{sender | seen: seen ||| bit}}, else: :doubled
  end
end
