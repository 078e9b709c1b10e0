defmodule Sim.Emulator.Spin do
  @moduledoc false
  # Turns an emulated lidar: which measurements are due by a time, and what each of them is in what it has around it. Pure. A lidar
  # turns clockwise, from where it looks ahead; its measurements are evenly spread in time.

  @enforce_keys [:per_s, :per_turn, :since_ms]
  defstruct @enforce_keys ++ [count: 0]

  @typedoc "`count` measurements were made since it has turned, so many a second and in a turn."
  @type t :: %__MODULE__{
          per_s: pos_integer(),
          per_turn: float(),
          since_ms: integer(),
          count: non_neg_integer()
        }

  @doc "A lidar that begins to turn."
  @spec start(pos_integer(), turns_a_second :: float(), at_ms :: integer()) :: t()
  def start(per_s, turns, at_ms),
    do: %__MODULE__{per_s: per_s, per_turn: per_s / turns, since_ms: at_ms}

  @doc "How many packets of so many measurements are due by now."
  @spec due(t(), pos_integer(), integer()) :: non_neg_integer()
  def due(spin, size, at_ms),
    do: div(div((at_ms - spin.since_ms) * spin.per_s, 1_000) - spin.count, size)

  @doc "When the next packet is due."
  @spec next_ms(t(), pos_integer()) :: integer()
  def next_ms(spin, size),
    do: spin.since_ms + div((spin.count + size) * 1_000 + spin.per_s - 1, spin.per_s)

  @doc "The angle of a measurement, degrees clockwise, 0 to 360; and whether it is the first of a turn."
  @spec angle(t(), non_neg_integer()) :: {float(), boolean()}
  def angle(spin, number) do
    turns = number / spin.per_turn

    {(turns - floor(turns)) * 360.0,
     number == 0 or floor(turns) > floor((number - 1) / spin.per_turn)}
  end

  @doc "The millimetres that something around it is away at this angle; 0 for nothing."
  @spec millimetres(Hal.Scan.t() | nil, float()) :: 0..65_535
  def millimetres(nil, _degrees), do: 0

  def millimetres(%Hal.Scan{start: start, step: step, ranges: ranges}, degrees) do
    turn = 2 * :math.pi()
    angle = -degrees * :math.pi() / 180 - start
    ray = round((angle - turn * floor(angle / turn)) / step)

    case div(byte_size(ranges), 2) do
      count when ray < count -> ray
      count -> rem(ray, max(count, 1))
    end
    |> at(ranges)
  end

  defp at(ray, ranges) do
    case ranges do
      <<_::binary-size(ray)-unit(16), mm::16, _::binary>> when mm < 65_535 -> mm
      _nothing -> 0
    end
  end
end
