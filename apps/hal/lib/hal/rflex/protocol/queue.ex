defmodule Hal.RFlex.Protocol.Queue do
  @moduledoc false
  # Decides which command to send next, and when: the controller loses commands that are less than
  # 10 ms apart. Pure; the caller waits and writes.
  #
  # Every command has a key. A newer command replaces a waiting one with the same key, and keeps its
  # place: so a key that is written often does not lose its turn, no outdated speed is sent, and
  # there are never more commands than keys. A stop discards the waiting speeds and goes first.

  @enforce_keys [:pace_ms]
  defstruct [:pace_ms, waiting: [], free_ms: nil]

  @type key :: atom() | {:speed | :prepare, 0 | 1}
  @type t :: %__MODULE__{
          pace_ms: pos_integer(),
          waiting: [{key(), binary()}],
          free_ms: integer() | nil
        }

  @doc "An empty queue; commands are sent `pace_ms` apart."
  @spec new(pos_integer()) :: t()
  def new(pace_ms), do: %__MODULE__{pace_ms: pace_ms}

  @doc """
  Adds a command, in the place of the waiting one with its key, or last.

      iex> alias Hal.RFlex.Protocol.Queue
      iex> queue = Queue.new(12) |> Queue.put(:a, "1") |> Queue.put(:b, "2")
      iex> Queue.put(queue, :a, "3").waiting
      [a: "3", b: "2"]
  """
  @spec put(t(), key(), binary()) :: t()
  def put(%__MODULE__{waiting: waiting} = queue, key, bytes) do
    %{queue | waiting: List.keystore(waiting, key, 0, {key, bytes})}
  end

  @doc """
  Adds a stop: the waiting speeds are discarded, and these commands go first.

      iex> alias Hal.RFlex.Protocol.Queue
      iex> queue = Queue.new(12) |> Queue.put(:a, "1") |> Queue.put({:speed, 0}, "2")
      iex> Queue.stop(queue, [{{:speed, 0}, "0"}]).waiting
      [{{:speed, 0}, "0"}, {:a, "1"}]
  """
  @spec stop(t(), [{key(), binary()}]) :: t()
  def stop(%__MODULE__{waiting: waiting} = queue, commands) do
    others = Enum.reject(waiting, fn {key, _bytes} -> match?({:speed, _}, key) end)
    %{queue | waiting: commands ++ others}
  end

  @doc "The command to write now, or how long to wait for the next one (ms), or `:empty`."
  @spec take(t(), integer()) :: {:send, binary(), t()} | {:wait, pos_integer()} | :empty
  def take(%__MODULE__{waiting: []}, _at_ms), do: :empty

  def take(%__MODULE__{free_ms: free_ms}, at_ms) when free_ms != nil and at_ms < free_ms,
    do: {:wait, free_ms - at_ms}

  def take(%__MODULE__{waiting: [{_key, bytes} | waiting]} = queue, at_ms),
    do: {:send, bytes, %{queue | waiting: waiting, free_ms: at_ms + queue.pace_ms}}

  @doc """
  The command that was taken has been written at this time: the pace counts from then, because a busy machine may have
  taken the processor away in between.

      iex> alias Hal.RFlex.Protocol.Queue
      iex> {:send, "1", queue} = Queue.new(12) |> Queue.put(:a, "1") |> Queue.take(0)
      iex> queue |> Queue.put(:b, "2") |> Queue.written(7) |> Queue.take(12)
      {:wait, 7}
  """
  @spec written(t(), integer()) :: t()
  def written(%__MODULE__{} = queue, at_ms), do: %{queue | free_ms: at_ms + queue.pace_ms}
end
