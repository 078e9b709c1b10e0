defmodule Robot.Player.Senses do
  @moduledoc """
  The options of Player's `rflex` driver for sonar, infrared and bumpers, in ours. Pure.
  """
  alias Robot.Player.Units

  @doc """
  What becomes of one option, `others` being all of that driver; nil of an option that is no sensor's, or
  has a value that it cannot have.
  """
  @spec option(String.t(), Robot.Player.Sections.value(), Units.context(), [tuple()]) ::
          Units.carried() | nil
  def option(name, value, context, others)

  # Theta first, in radians, says the driver; some files have it last.
  def option(name, {:tuple, numbers}, context, _others)
      when name in ~w(mmrad_sonar_poses mrad_sonar_poses) do
    with {:ok, triples} <- triples(numbers) do
      last? =
        Enum.any?(triples, fn {first, _, _} -> not Units.radians?(first) end) and
          Enum.all?(triples, fn {_, _, third} -> Units.radians?(third) end)

      first? = Enum.all?(triples, fn {first, _, _} -> Units.radians?(first) end)

      cond do
        last? ->
          triples
          |> Enum.map(fn {x, y, angle} -> {x, y, Units.radians(angle)} end)
          |> sensors(:sonars, context, "read as x, y, theta: the first numbers are no angles")

        first? ->
          triples
          |> Enum.map(fn {angle, x, y} -> {x, y, Units.radians(angle)} end)
          |> sensors(:sonars, context, nil)

        true ->
          {:left, "neither its first nor its last numbers are angles in radians"}
      end
    end
  end

  def option("poses", {:tuple, numbers}, context, _others) do
    with {:ok, triples} <- triples(numbers) do
      {angles, assumed} = triples |> Enum.map(&elem(&1, 2)) |> Units.angles(context)

      triples
      |> Enum.zip(angles)
      |> Enum.map(fn {{x, y, _}, angle} -> {x, y, angle} end)
      |> sensors(:irs, context, assumed)
    end
  end

  def option("ir_max_range", range, context, _others) when is_number(range) and range > 0,
    do: Units.told(Units.length_m(range, context), &[{[:body, :ir_max], &1}])

  # The older driver has mm = (a V)^b, the newer one m = a V^b, as we have.
  def option("rflex_ir_calib", {:tuple, numbers}, context, _others) do
    pairs = Enum.chunk_every(numbers, 2)

    if pairs != [] and length(pairs) <= 32 and Enum.all?(pairs, &pair?/1) do
      {as, bs} = pairs |> Enum.map(&calibration(&1, context)) |> Enum.unzip()
      {:ok, [{[:drive, :conversions, :ir_a], one(as)}, {[:drive, :conversions, :ir_b], one(bs)}]}
    else
      {:left, "is no list of pairs a b, a from 1.0e-9 to 1.0e9, b from -10 to 10"}
    end
  end

  def option("num_sonars_in_bank", {:tuple, banks}, _context, others) do
    sonars = length(numbers("mmrad_sonar_poses", others) ++ numbers("mrad_sonar_poses", others))

    cond do
      not Enum.all?(banks, &(is_integer(&1) and &1 in 0..16)) ->
        {:left, "a bank has 0 to 16 sonars"}

      sonars > 0 and Enum.sum(banks) != div(sonars, 3) ->
        {:left, "there are poses for #{div(sonars, 3)} sonars, not for #{Enum.sum(banks)}"}

      true ->
        {:ok, [{[:drive, :sonar_banks], banks}]}
    end
  end

  def option("bumper_count", count, _context, _others) when is_integer(count) do
    if count in 0..16,
      do: {:ok, [{[:body, :bumpers], count} | bumper_count(count)]},
      else: {:left, "0 to 16 bumpers are possible"}
  end

  def option("rflex_bumper_style", style, _context, _others) when style in ["bit", "addr"] do
    ours = if style == "bit", do: :bit, else: :address
    {:ok, [{[:drive, :bumpers, :style], ours}]}
  end

  def option("rflex_bumper_address", base, _context, _others) when base in 0..255,
    do: {:ok, [{[:drive, :bumpers, :base], base}]}

  def option("num_sonars", count, _context, others) when is_integer(count) do
    case length(numbers("mmrad_sonar_poses", others) ++ numbers("mrad_sonar_poses", others)) do
      given when given == 3 * count or given == 0 -> :used
      given -> {:left, "there are poses for #{div(given, 3)} sonars"}
    end
  end

  def option("pose_count", count, _context, others) when is_integer(count) do
    case length(numbers("poses", others)) do
      given when given == 3 * count or given == 0 -> :used
      given -> {:left, "there are poses for #{div(given, 3)} infrareds"}
    end
  end

  def option("num_sonars_possible_per_bank", stride, _context, _others) when stride in 1..16,
    do: {:ok, [{[:drive, :sonar_stride], stride}]}

  def option("sonar_age", age, _context, _others) when age in 1..20,
    do: {:ok, [{[:drive, :sonar_age], age}]}

  # Three options of theirs are one of ours; Robot.Player puts them together.
  def option("sonar_" <> delay, us, _context, _others)
      when delay in ~w(echo_delay ping_delay set_delay) and us in 0..1_000_000,
      do: {:ok, [{[:drive, :sonar_times, time(delay)], us}]}

  def option("rflex_banks", {:tuple, banks}, _context, others) do
    irs = div(length(numbers("poses", others)), 3)

    cond do
      not Enum.all?(banks, &(&1 in 0..8)) or length(banks) > 8 ->
        {:left, "a board has 0 to 8 infrareds, and there are 8 boards"}

      irs > 0 and Enum.sum(banks) != irs ->
        {:left, "there are poses for #{irs} infrareds, not for #{Enum.sum(banks)}"}

      true ->
        {:ok, [{[:drive, :ir_banks], banks}]}
    end
  end

  def option("rflex_base_bank", bank, _context, _others) when bank in 0..7,
    do: {:ok, [{[:drive, :ir_base_bank], bank}]}

  def option("ir_min_range", range, context, _others) when is_number(range) and range >= 0,
    do: Units.told(Units.length_m(range, context), &[{[:drive, :ir_min], &1}])

  def option(name, _value, _context, _others)
      when name in ~w(max_num_sonars num_sonar_banks rflex_bank_count),
      do: :used

  def option(_name, _value, _context, _others), do: nil

  defp bumper_count(0), do: []
  defp bumper_count(count), do: [{[:drive, :bumpers, :count], count}]

  defp time("echo_delay"), do: :echo
  defp time("ping_delay"), do: :ping
  defp time("set_delay"), do: :set

  defp sensors(places, key, context, assumed) do
    {places, more} = Units.places(places, context)
    Units.told({places, join(assumed, more)}, &[{[:body, key], &1}])
  end

  defp triples(numbers) do
    if Enum.all?(numbers, &is_number/1) and rem(length(numbers), 3) == 0 and numbers != [],
      do: {:ok, numbers |> Enum.chunk_every(3) |> Enum.map(&List.to_tuple/1)},
      else: {:left, "is no list of three numbers for each sensor"}
  end

  defp numbers(name, others) do
    case List.keyfind(others, name, 0) do
      {_name, _line, {:tuple, numbers}} -> numbers
      _none -> []
    end
  end

  defp pair?([a, b]),
    do: is_number(a) and is_number(b) and a >= 1.0e-9 and a <= 1.0e9 and abs(b) <= 10

  defp pair?(_other), do: false

  defp calibration([a, b], %{version: 1}), do: {:math.pow(a, b) / 1000, b * 1.0}
  defp calibration([a, b], %{version: 2}), do: {a * 1.0, b * 1.0}

  defp one(values), do: if(length(Enum.uniq(values)) == 1, do: hd(values), else: values)

  defp join(nil, more), do: more
  defp join(assumed, nil), do: assumed
  defp join(assumed, more), do: "#{assumed}; #{more}"
end
