defmodule Robot.Player.Base do
  @moduledoc """
  The options of Player's `rflex` driver in ours, one by one. Pure; names, units and defaults of both
  generations of that driver are those of its documentation.
  """
  alias Hal.Suggest
  alias Robot.Player.Units

  @typedoc """
  What becomes of an option: values for keys of the robot file, perhaps with what was assumed;
  nothing, as it says nothing of its own; or why it is left out.
  """
  @type carried ::
          {:ok, [{path :: [atom()], term()}]}
          | {:assumed, [{path :: [atom()], term()}], String.t()}
          | :used
          | {:left, String.t()}

  @doc """
  What becomes of one option; `others` are all of that driver.

      iex> units = %{version: 1, unit_length: 1.0, unit_angle: nil}
      iex> Robot.Player.Base.option("odo_distance_conversion", 190, units, [])
      {:ok, [{[:drive, :conversions, :distance], 190_000.0}]}
  """
  @spec option(String.t(), Robot.Player.Sections.value(), Units.context(), [tuple()]) :: carried()
  def option(name, value, context, others)

  def option("rflex_serial_port", port, _context, _others) when is_binary(port),
    do: {:ok, [{[:drive, :port], port}]}

  def option(name, length, context, _others)
      when name in ~w(mm_length m_length mm_width m_width) and is_number(length) and length > 0 do
    key = if name =~ "length", do: :length, else: :width
    told(Units.length_m(length, context), &[{[:body, key], &1}])
  end

  def option("odo_distance_conversion", units, context, _others)
      when is_number(units) and units > 0,
      do: per_metre([:drive, :conversions, :distance], units, context, 2_000)

  def option("odo_angle_conversion", units, _context, _others)
      when is_number(units) and units > 0,
      do: {:ok, [{[:drive, :conversions, :angle], units * 1.0}]}

  def option("range_distance_conversion", units, context, _others)
      when is_number(units) and units > 0,
      do: per_metre([:drive, :conversions, :range], units, context, 20)

  # m/s2 or mm/s2; nobody accelerates a robot by more than 10 m/s2.
  def option("default_trans_acceleration", value, context, _others)
      when is_number(value) and value > 0 do
    told(Units.length_m(value, context), &[{[:limits, :max_acceleration], &1}])
  end

  def option("default_rot_acceleration", value, _context, _others)
      when is_number(value) and value > 0,
      do: {:ok, [{[:limits, :max_turn_acceleration], value * 1.0}]}

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
    do: told(Units.length_m(range, context), &[{[:body, :ir_max], &1}])

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
    do: told(Units.length_m(range, context), &[{[:drive, :ir_min], &1}])

  # Tenths of a volt in the older files, volts in the newer ones.
  def option("rflex_power_offset", offset, context, _others) when is_number(offset) do
    cond do
      context.version == 1 ->
        {:ok, [{[:drive, :power_offset], offset / 10}]}

      abs(offset) > 5 ->
        {:assumed, [{[:drive, :power_offset], offset / 10}], "taken for tenths of a volt"}

      true ->
        {:ok, [{[:drive, :power_offset], offset * 1.0}]}
    end
  end

  def option("rflex_joystick", use, _context, _others) when use in [0, 1],
    do: if(use == 1, do: {:ok, [{[:drive, :joystick], true}]}, else: :used)

  def option("rflex_heading_home_address", 0, _context, _others), do: :used

  def option("rflex_heading_home_address", address, _context, _others) when address in 1..255,
    do: {:ok, [{[:drive, :home], address}]}

  def option("rflex_home_on_start", 0, _context, _others), do: :used

  def option(name, _value, _context, _others)
      when name in ~w(max_num_sonars num_sonar_banks rflex_bank_count),
      do: :used

  def option(name, _value, _context, _others), do: {:left, reason(name)}

  defp bumper_count(0), do: []
  defp bumper_count(count), do: [{[:drive, :bumpers, :count], count}]

  defp time("echo_delay"), do: :echo
  defp time("ping_delay"), do: :ping
  defp time("set_delay"), do: :set

  @reasons %{
    "sonar_2nd_bank_start" => "all sonars are one list here",
    "bumper_def" => "bumpers are parts of the body here, counted from its front",
    "sonar_max_range" => "a sonar sees as far as the body's sonar_max says",
    "rflex_joy_pos_ratio" => "the joystick is read, but drives nothing by itself",
    "rflex_joy_ang_ratio" => "the joystick is read, but drives nothing by itself",
    "rflex_home_on_start" => "no robot turns by itself when it is switched on"
  }
  @known ~w(rflex_serial_port mm_length m_length mm_width m_width odo_distance_conversion
            odo_angle_conversion range_distance_conversion default_trans_acceleration
            default_rot_acceleration mmrad_sonar_poses mrad_sonar_poses poses ir_max_range
            ir_min_range rflex_ir_calib num_sonars_in_bank bumper_count rflex_bumper_style
            rflex_bumper_address num_sonars pose_count num_sonars_possible_per_bank sonar_age
            sonar_echo_delay sonar_ping_delay sonar_set_delay rflex_banks rflex_base_bank
            rflex_power_offset rflex_joystick rflex_heading_home_address)

  defp reason(name) when is_map_key(@reasons, name), do: @reasons[name]
  defp reason(name) when name in @known, do: "has a value that it cannot have"
  defp reason(name), do: "is no option of rflex#{hint(Suggest.nearest(name, @known))}"

  defp hint(nil), do: ""
  defp hint(near), do: "; was #{near} meant?"

  defp per_metre(path, units, context, least) do
    cond do
      context.version == 1 ->
        {:ok, [{path, Float.round(units * 1000.0, 6)}]}

      units < least ->
        {:assumed, [{path, Float.round(units * 1000.0, 6)}],
         "taken for units per millimetre: #{units} per metre is no rFLEX"}

      true ->
        {:ok, [{path, units * 1.0}]}
    end
  end

  defp sensors(places, key, context, assumed) do
    {places, more} = Units.places(places, context)
    told({places, join(assumed, more)}, &[{[:body, key], &1}])
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

  defp told({value, nil}, pairs), do: {:ok, pairs.(value)}
  defp told({value, assumed}, pairs), do: {:assumed, pairs.(value), assumed}

  defp join(nil, more), do: more
  defp join(assumed, nil), do: assumed
  defp join(assumed, more), do: "#{assumed}; #{more}"
end
