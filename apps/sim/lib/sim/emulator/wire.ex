defmodule Sim.Emulator.Wire do
  @moduledoc """
  Simulates one direction of an imperfect serial line: bytes are lost, duplicated, delayed, or have one bit flipped; and
  the line can be unplugged. Pure: what happens to the n-th byte is a hash of the seed, the direction and n
  (`Sim.Noise`), so the same bytes meet the same faults again.

  | option | allowed | default |
  |---|---|---|
  | `:drop`, `:double`, `:flip` | share of bytes, 0 to 1, together at most 1 | 0 |
  | `:delay_ms` | `{least, most}`, whole milliseconds, for bytes that are sent together | `{0, 0}` |
  | `:seed` | whole number | 0 |
  | `:way` | whole number that distinguishes directions with one seed | 0 |

  Bytes never overtake each other.
  """
  import Bitwise
  alias Hal.Options
  alias Sim.Noise

  @enforce_keys [:drop, :double, :flip, :delay_ms, :seed, :way]
  defstruct @enforce_keys ++
              [count: 0, sent: 0, queue: :queue.new(), last_ms: nil, plugged?: true]

  @type t :: %__MODULE__{}

  @table [
    drop: [{:number, 0, 1}, default: 0.0],
    double: [{:number, 0, 1}, default: 0.0],
    flip: [{:number, 0, 1}, default: 0.0],
    delay_ms: [{:span, 0, 60_000, "whole ms"}, default: {0, 0}],
    seed: [:integer, default: 0],
    way: [:integer, default: 0]
  ]

  @doc """
  A wire; the error is one line that names what is wrong with its options.

      iex> {:ok, wire} = Sim.Emulator.Wire.new(drop: 0.02)
      iex> wire.flip
      0.0
      iex> Sim.Emulator.Wire.new(drop: 2)
      {:error, "wire option drop: expected a number from 0 to 1, got 2"}
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, line :: String.t()}
  def new(options \\ []) do
    with {:ok, options} <- Options.check(options, @table, "wire") do
      if options[:drop] + options[:double] + options[:flip] > 1,
        do: {:error, "wire options drop, double and flip: expected at most 1 together"},
        else: {:ok, struct!(__MODULE__, options)}
    end
  end

  @doc """
  Sends bytes into the wire; a pulled one loses them.

      iex> {:ok, wire} = Sim.Emulator.Wire.new(delay_ms: {5, 5})
      iex> {early, wire} = wire |> Sim.Emulator.Wire.put("ab", 100) |> Sim.Emulator.Wire.take(104)
      iex> {late, _wire} = Sim.Emulator.Wire.take(wire, 105)
      iex> {early, late}
      {"", "ab"}
  """
  @spec put(t(), iodata(), integer()) :: t()
  def put(%__MODULE__{plugged?: false} = wire, _bytes, _at_ms), do: wire

  def put(%__MODULE__{} = wire, bytes, at_ms) do
    case IO.iodata_to_binary(bytes) do
      <<>> -> wire
      bytes -> queue(wire, spoil(wire, bytes), byte_size(bytes), at_ms)
    end
  end

  defp queue(%{delay_ms: {least, most}} = wire, bytes, size, at_ms) do
    draw = Noise.hash(wire.seed, wire.way, wire.sent, 1)
    due_ms = at_ms + least + rem(draw, most - least + 1)
    due_ms = if wire.last_ms, do: max(due_ms, wire.last_ms), else: due_ms

    %{
      wire
      | count: wire.count + size,
        sent: wire.sent + 1,
        last_ms: due_ms,
        queue: :queue.in({due_ms, bytes}, wire.queue)
    }
  end

  defp spoil(%{drop: drop, double: double, flip: flip}, bytes)
       when drop == 0 and double == 0 and flip == 0,
       do: bytes

  defp spoil(%{count: count} = wire, bytes) do
    for {byte, k} <- Enum.with_index(:binary.bin_to_list(bytes), count),
        draw = Noise.unit(Noise.hash(wire.seed, wire.way, k, 0)),
        into: <<>>,
        do: spoil_one(wire, byte, draw, k)
  end

  defp spoil_one(%{drop: drop}, _byte, draw, _k) when draw < drop, do: <<>>

  defp spoil_one(%{drop: drop, double: double}, byte, draw, _k) when draw < drop + double,
    do: <<byte, byte>>

  defp spoil_one(%{drop: drop, double: double, flip: flip} = wire, byte, draw, k)
       when draw < drop + double + flip,
       do: <<bxor(byte, 1 <<< rem(Noise.hash(wire.seed, wire.way, k, 2), 8))>>

  defp spoil_one(_wire, byte, _draw, _k), do: <<byte>>

  @doc "The bytes that have arrived at the other end by now."
  @spec take(t(), integer()) :: {binary(), t()}
  def take(%__MODULE__{} = wire, at_ms), do: take(wire, at_ms, [])

  defp take(wire, at_ms, taken) do
    case :queue.peek(wire.queue) do
      {:value, {due_ms, bytes}} when due_ms <= at_ms ->
        take(%{wire | queue: :queue.drop(wire.queue)}, at_ms, [taken | bytes])

      _later_or_empty ->
        {IO.iodata_to_binary(taken), wire}
    end
  end

  @doc "When the next byte arrives; `nil` if nothing is on its way."
  @spec next_ms(t()) :: integer() | nil
  def next_ms(%__MODULE__{queue: queue}) do
    case :queue.peek(queue) do
      {:value, {due_ms, _bytes}} -> due_ms
      :empty -> nil
    end
  end

  @doc """
  Pulls the wire: what is on its way is lost, and so is all that is sent until it is plugged in.
  """
  @spec pull(t()) :: t()
  def pull(%__MODULE__{} = wire), do: %{wire | plugged?: false, queue: :queue.new(), last_ms: nil}

  @doc "Plugs the wire in again."
  @spec plug(t()) :: t()
  def plug(%__MODULE__{} = wire), do: %{wire | plugged?: true}
end
