defmodule Hal.Visca.Units do
  @moduledoc """
  Converts between radians and the numbers of a camera (`Hal.Visca.Model`; fact sheet, section 5).
  Pure. The numbers here are those of an EVI-D30, the default:

  | what | here | in the camera |
  |---|---|---|
  | pan | radians, left positive, 100 degrees to each side | -880 to 880, **right** positive, 8.8 a degree |
  | tilt | radians, up positive, 25 degrees each way | -300 to 300, up positive, 12 a degree |
  | pan speed | rad/s, up to 80 degrees/s | 1 to 24, 10/3 degrees/s each |
  | tilt speed | rad/s, up to 50 degrees/s | 1 to 20, 2.5 degrees/s each |
  | zoom | horizontal field of view, radians | 0 (wide) to 1023 (tele) |

  A request beyond a range becomes the end of the range: a head that should look behind itself
  looks as far as it can. The field of view is taken as linear in the zoom, as Player does, which
  it is not (the sheet says so, and has no better source).
  """

  alias Hal.Visca.Model

  @degree :math.pi() / 180

  @typedoc "Fields of view, tele and wide, in radians."
  @type lens :: {tele :: float(), wide :: float()}

  @doc """
  The camera's pan for an angle in radians.

      iex> Hal.Visca.Units.pan(:math.pi() / 6)
      -264
      iex> Hal.Visca.Units.pan(-9.0)
      880
  """
  @spec pan(float(), Model.t()) :: integer()
  def pan(radians, model \\ Model.get(:d30)) when is_number(radians),
    do: steps(-radians, model.pan_degree, model.pan)

  @doc """
  The camera's tilt for an angle in radians.

      iex> Hal.Visca.Units.tilt(-:math.pi() / 18)
      -120
  """
  @spec tilt(float(), Model.t()) :: integer()
  def tilt(radians, model \\ Model.get(:d30)) when is_number(radians),
    do: steps(radians, model.tilt_degree, model.tilt)

  @doc """
  A pan and a tilt of the camera in radians.

      iex> {pan, tilt} = Hal.Visca.Units.angles(-264, 120)
      iex> {Float.round(pan, 4), Float.round(tilt, 4)}
      {0.5236, 0.1745}
  """
  @spec angles(pan :: integer(), tilt :: integer(), Model.t()) :: {float(), float()}
  # Subtracted from zero, not negated: a zero with a sign is of no use.
  def angles(pan, tilt, model \\ Model.get(:d30)) when is_integer(pan) and is_integer(tilt),
    do: {(0 - pan) / model.pan_degree * @degree, tilt / model.tilt_degree * @degree}

  @doc """
  Whether the camera can have this position, with a degree to spare.

      iex> Hal.Visca.Units.position?(-880, 300)
      true
      iex> Hal.Visca.Units.position?(0, 4000)
      false
  """
  @spec position?(integer(), integer(), Model.t()) :: boolean()
  def position?(pan, tilt, model \\ Model.get(:d30)) do
    within?(pan, model.pan, ceil(model.pan_degree)) and
      within?(tilt, model.tilt, ceil(model.tilt_degree))
  end

  defp within?(units, {least, greatest}, spare),
    do: units >= least - spare and units <= greatest + spare

  @doc """
  The camera's pan speed nearest to this rate in rad/s, at least 1 (the slowest).

      iex> Hal.Visca.Units.pan_speed(20 * :math.pi() / 180)
      6
  """
  @spec pan_speed(float()) :: 1..24
  def pan_speed(rate) when is_number(rate), do: speed(rate, 10 / 3, 24)

  @doc """
  The camera's tilt speed nearest to this rate in rad/s, at least 1.

      iex> Hal.Visca.Units.tilt_speed(9.0)
      20
  """
  @spec tilt_speed(float()) :: 1..20
  def tilt_speed(rate) when is_number(rate), do: speed(rate, 2.5, 20)

  @doc """
  A drive command for these rates in rad/s: `{direction, speed}` for each axis, pan positive to
  the left, tilt positive upwards. A rate below half the slowest speed is a stop.

      iex> Hal.Visca.Units.drive(20 * :math.pi() / 180, 0.0)
      {:drive, {:left, 6}, {:stop, 0}}
  """
  @spec drive(float(), float()) :: Hal.Visca.Command.t()
  def drive(pan_rate, tilt_rate) when is_number(pan_rate) and is_number(tilt_rate) do
    {:drive, axis(pan_rate, :left, :right, 10 / 3, &pan_speed/1),
     axis(tilt_rate, :up, :down, 2.5, &tilt_speed/1)}
  end

  @doc """
  The zoom for a horizontal field of view, in radians.

      iex> degree = :math.pi() / 180
      iex> Hal.Visca.Units.zoom(15 * degree, {3 * degree, 30 * degree})
      569
      iex> Hal.Visca.Units.zoom(9.0, {3 * degree, 30 * degree})
      0
  """
  @spec zoom(float(), lens(), Model.t()) :: 0..0x4000
  def zoom(angle, {tele, wide}, model \\ Model.get(:d30))
      when is_number(angle) and 0 < tele and tele < wide do
    angle = angle |> max(tele) |> min(wide)
    min(round(model.zoom_span * (wide - angle) / (wide - tele)), model.zoom)
  end

  @doc """
  The horizontal field of view at a zoom, in radians.

      iex> degree = :math.pi() / 180
      iex> angle = Hal.Visca.Units.field_of_view(568, {3 * degree, 30 * degree})
      iex> Float.round(angle / degree, 2)
      15.02
  """
  @spec field_of_view(integer(), lens(), Model.t()) :: float()
  def field_of_view(zoom, {tele, wide}, model \\ Model.get(:d30))
      when is_integer(zoom) and 0 < tele and tele < wide do
    zoom = zoom |> max(0) |> min(model.zoom)
    wide - zoom / model.zoom_span * (wide - tele)
  end

  # Limited before the conversion to an integer: a huge float would make a huge integer.
  defp steps(radians, per_degree, {least, greatest}) do
    unit = @degree / per_degree
    round((radians |> max(least * unit) |> min(greatest * unit)) / unit)
  end

  defp speed(rate, step, most) do
    rate = min(abs(rate), most * step * @degree)
    max(round(rate / (step * @degree)), 1)
  end

  defp axis(rate, positive, negative, step, speed) do
    cond do
      abs(rate) < step * @degree / 2 -> {:stop, 0}
      rate > 0 -> {positive, speed.(rate)}
      true -> {negative, speed.(rate)}
    end
  end
end
