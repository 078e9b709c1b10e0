defmodule Robot.Calibration.Ranges do
  @moduledoc """
  Estimates the conversions of sonars and infrareds from what they told of a wall at known distances. Pure; metres.

  A sonar's range is proportional to its units, so their number for a metre is found by least squares through the origin. The
  law of an infrared, a * V^b, is a line in logarithms: the two constants are those of the line through the points.
  """

  @typedoc "How far the wall truly was, and what the sensor told."
  @type pair :: {true_m :: float(), told_m :: float()}
  @type law :: :metres | :millimetres

  # Beyond this factor it was not the wall that was heard.
  @most 1.5

  @doc """
  The units per metre of a sonar that has so many now, and by how much the farthest off of the distances would then be told wrong.

      iex> Robot.Calibration.Ranges.sonar([{0.5, 0.55}, {1.0, 1.1}, {2.0, 2.2}], 1000.0)
      {:ok, 1100.0, 0.0}
      iex> Robot.Calibration.Ranges.sonar([{1.0, 5.1}], 1474.0)
      {:error, "at 1.0 m it told 5.1 m: that was not the wall"}
  """
  @spec sonar([pair(), ...], units :: float()) ::
          {:ok, units :: float(), worst_m :: float()} | {:error, String.t()}
  def sonar(pairs, units) do
    with :ok <- heard(pairs) do
      squares = Enum.sum(for {truth, _told} <- pairs, do: truth * truth)
      scale = Enum.sum(for {truth, told} <- pairs, do: truth * told) / squares
      worst = pairs |> Enum.map(fn {truth, told} -> abs(told / scale - truth) end) |> Enum.max()
      {:ok, Float.round(units * scale, 2), Float.round(worst, 3)}
    end
  end

  @doc """
  The constants of an infrared's law, of one that has these now, and by how much the farthest off of the distances would then be
  told wrong. Two distances at least are needed.

      iex> law = fn v, {a, b} -> a * :math.pow(v, b) end
      iex> pairs = for v <- [90.0, 110.0, 150.0], do: {law.(v, {5000.0, -2.1}), law.(v, {4000.0, -2.0})}
      iex> Robot.Calibration.Ranges.infrared(pairs, {4000.0, -2.0}, :metres)
      {:ok, {5000.0, -2.1}, 0.0}
      iex> Robot.Calibration.Ranges.infrared([{0.3, 0.3}], {4000.0, -2.0}, :metres)
      {:error, "an infrared needs two different distances at least"}
  """
  @spec infrared([pair(), ...], {a :: float(), b :: float()}, law()) ::
          {:ok, {float(), float()}, worst_m :: float()} | {:error, String.t()}
  def infrared(pairs, constants, law) do
    points =
      for {truth, told} <- pairs,
          told > 0,
          do: {:math.log(voltage(told, constants, law)), log(truth, law)}

    with :ok <- heard(pairs), {:ok, slope, height} <- line(points) do
      found = constants(slope, height, law)

      worst =
        for {truth, told} <- pairs, told > 0 do
          abs(metres(voltage(told, constants, law), found, law) - truth)
        end
        |> Enum.max()

      {:ok, found, Float.round(worst, 3)}
    end
  end

  defp heard(pairs) do
    Enum.find_value(pairs, :ok, fn {truth, told} ->
      if told > truth * @most or told < truth / @most,
        do:
          {:error, "at #{truth} m it told #{Float.round(told * 1.0, 2)} m: that was not the wall"}
    end)
  end

  defp voltage(told, {a, b}, :metres), do: :math.pow(told / a, 1 / b)
  defp voltage(told, {a, b}, :millimetres), do: :math.pow(1_000 * told, 1 / b) / a

  defp metres(voltage, {a, b}, :metres), do: a * :math.pow(voltage, b)
  defp metres(voltage, {a, b}, :millimetres), do: :math.pow(a * voltage, b) / 1_000

  defp log(truth, :metres), do: :math.log(truth)
  defp log(truth, :millimetres), do: :math.log(1_000 * truth)

  defp constants(slope, height, :metres), do: {significant(:math.exp(height)), significant(slope)}

  defp constants(slope, height, :millimetres),
    do: {significant(:math.exp(height / slope)), significant(slope)}

  # Six digits.
  defp significant(number),
    do: number |> :erlang.float_to_binary(scientific: 5) |> String.to_float()

  defp line(points) do
    count = length(points)
    {mx, my} = {mean(points, 0), mean(points, 1)}
    square = Enum.sum(for {x, _y} <- points, do: (x - mx) * (x - mx))

    if count < 2 or square < 1.0e-6 do
      {:error, "an infrared needs two different distances at least"}
    else
      slope = Enum.sum(for {x, y} <- points, do: (x - mx) * (y - my)) / square
      {:ok, slope, my - slope * mx}
    end
  end

  defp mean([], _which), do: 0.0
  defp mean(points, which), do: Enum.sum(Enum.map(points, &elem(&1, which))) / length(points)
end
