defmodule Hal.TurtleBot3.Readings do
  @moduledoc false
  # Turns the control table of a TurtleBot3's board into readings. Pure; times are whole milliseconds.
  alias Hal.{Pose, SerialBase}

  # Bytes 10 to 181 of the table.
  @from 10
  @size 172
  @metres_per_tick 2 * :math.pi() * 0.033 / 4096
  # What a wheel does at the greatest speed of the body, and the most that turning adds.
  @max_wheel 0.7
  # Below this there is no battery.
  @least_volts 7.0

  @enforce_keys [:odometry]
  defstruct @enforce_keys ++ [last: nil, status: 0, torque: nil, heading: nil, restarts: 0]

  @typedoc "`last` is `{time of the board, time of its arrival}` of the last block; `heading` that of the board's own sensors (radians)."
  @type t :: %__MODULE__{}

  @doc "The state before the first block; the wheels are so far apart (m), `before` is the odometry of the same base."
  @spec new(wheel_base :: float(), SerialBase.Odometry.t() | nil) :: t()
  def new(wheel_base, before) do
    odometry = before || SerialBase.Odometry.new(32, @metres_per_tick, wheel_base, @max_wheel)

    %__MODULE__{odometry: odometry}
  end

  @doc "The part of the table that is read: its address and size."
  @spec block() :: {non_neg_integer(), pos_integer()}
  def block, do: {@from, @size}

  @doc "Takes this part of the table."
  @spec table(t(), binary(), integer()) :: {[Hal.Drive.reading()], t()}
  def table(%__MODULE__{} = senses, table, at_ms) when byte_size(table) == @size do
    time = whole(table, 10)
    <<status::signed-8>> = binary_part(table, 18 - @from, 1)
    heading = heading(for address <- [96, 100, 104, 108], do: real(table, address))
    {elapsed_ms, restarted?} = SerialBase.Odometry.elapsed(senses.last, time, at_ms, 32)

    report = %{
      left: whole(table, 136),
      right: whole(table, 140),
      at_ms: at_ms,
      elapsed_ms: elapsed_ms,
      turn: heading && senses.heading && Pose.wrap(heading - senses.heading),
      restarted?: restarted?
    }

    {odometry, counted} = SerialBase.Odometry.report(senses.odometry, report)

    senses = %{
      senses
      | odometry: counted,
        last: {time, at_ms},
        status: status,
        torque: :binary.at(table, 149 - @from),
        heading: heading,
        restarts: senses.restarts + if(restarted?, do: 1, else: 0)
    }

    volts = whole(table, 42) / 100
    power = if volts >= @least_volts, do: [power: volts], else: []
    {if(odometry, do: [odometry: odometry], else: []) ++ power, senses}
  end

  defp whole(table, address) do
    <<number::little-signed-32>> = binary_part(table, address - @from, 4)
    number
  end

  # What is no number, or infinite, is `nil`.
  defp real(table, address) do
    case binary_part(table, address - @from, 4) do
      <<number::little-float-32>> -> number
      _no_number -> nil
    end
  end

  defp heading([w, x, y, z] = quaternion) do
    length = if nil in quaternion, do: 0.0, else: w * w + x * x + y * y + z * z
    # Before its sensors are calibrated it may be no turn at all.
    if length > 0.5 and length < 2.0,
      do: :math.atan2(x * y + w * z, 0.5 - y * y - z * z)
  end

  @doc "Whether the wheels may turn."
  @spec able(t()) :: :ok | {:error, line :: String.t()}
  def able(%__MODULE__{status: -1}), do: {:error, "its motors are not connected to its board"}
  def able(%__MODULE__{torque: 0}), do: {:error, "its motors have no torque"}
  def able(%__MODULE__{}), do: :ok
end
