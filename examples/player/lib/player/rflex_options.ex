defmodule Player.RFlexOptions do
  @moduledoc """
  Translates the options of Player's `rflex` driver to ours, one by one; `Player.Senses`
  translates those of its sensors. Pure. Names, units and defaults of both generations of that
  driver are taken from its documentation.
  """
  alias Hal.Options.Suggest
  alias Player.{Senses, Units}

  @doc """
  Translates one option; `others` are all options of that driver.

      iex> units = %{version: 1, unit_length: 1.0, unit_angle: nil}
      iex> Player.RFlexOptions.option("odo_distance_conversion", 190, units, [])
      {:ok, [{[:drive, :conversions, :distance], 190_000.0}]}
  """
  @spec option(String.t(), Player.Sections.value(), Units.context(), [tuple()]) ::
          Units.carried()
  def option(name, value, context, others)

  def option("rflex_serial_port", port, _context, _others) when is_binary(port),
    do: {:ok, [{[:drive, :port], port}]}

  def option(name, length, context, _others)
      when name in ~w(mm_length m_length mm_width m_width) and is_number(length) and length > 0 do
    key = if name =~ "length", do: :length, else: :width
    Units.told(Units.length_m(length, context), &[{[:body, key], &1}])
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

  # In m/s2 or mm/s2: no robot accelerates by more than 10 m/s2.
  def option("default_trans_acceleration", value, context, _others)
      when is_number(value) and value > 0 do
    Units.told(Units.length_m(value, context), &[{[:limits, :max_acceleration], &1}])
  end

  def option("default_rot_acceleration", value, _context, _others)
      when is_number(value) and value > 0,
      do: {:ok, [{[:limits, :max_turn_acceleration], value * 1.0}]}

  # In tenths of a volt in the older files, in volts in the newer ones.
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

  def option(name, value, context, others),
    do: Senses.option(name, value, context, others) || {:left, reason(name)}

  @reasons %{
    "sonar_2nd_bank_start" => "all sonars are one list here",
    "sonar_max_range" => "a sonar sees as far as the body's sonar_max says",
    "rflex_joy_pos_ratio" => "is part of joystick_ratios: of the drive, {m/s, rad/s} a count",
    "rflex_joy_ang_ratio" => "is part of joystick_ratios: of the drive, {m/s, rad/s} a count",
    "rflex_home_on_start" => "no robot turns by itself when it is switched on"
  }
  @known ~w(rflex_serial_port mm_length m_length mm_width m_width odo_distance_conversion
            odo_angle_conversion range_distance_conversion default_trans_acceleration
            default_rot_acceleration mmrad_sonar_poses mrad_sonar_poses poses ir_max_range
            ir_min_range rflex_ir_calib num_sonars_in_bank bumper_count bumper_def rflex_bumper_style
            rflex_bumper_address num_sonars pose_count num_sonars_possible_per_bank sonar_age
            sonar_echo_delay sonar_ping_delay sonar_set_delay rflex_banks rflex_base_bank
            rflex_power_offset rflex_joystick rflex_heading_home_address)

  defp reason(name) when is_map_key(@reasons, name), do: @reasons[name]
  defp reason(name) when name in @known, do: "has an impossible value"
  defp reason(name), do: "is not an option of rflex#{Suggest.hint(name, @known)}"

  defp per_metre(path, units, context, least) do
    cond do
      context.version == 1 ->
        {:ok, [{path, Float.round(units * 1000.0, 6)}]}

      units < least ->
        {:assumed, [{path, Float.round(units * 1000.0, 6)}],
         "taken for units per millimetre: #{units} per metre is not an rFLEX value"}

      true ->
        {:ok, [{path, units * 1.0}]}
    end
  end
end
