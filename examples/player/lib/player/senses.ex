defmodule Player.Senses do
  @moduledoc """
  Converts the options of Player's `rflex` driver for sonar, infrared and bumpers to ours. Pure.
  """
  alias Player.{Poses, Units}

  @doc """
  Translates one option; `others` are all options of that driver. Returns `nil` for an option that
  is not a sensor's, or has an impossible value.
  """
  @spec option(String.t(), Player.Sections.value(), Units.context(), [tuple()]) ::
          Units.carried() | nil
  def option(name, value, context, others)

  # The driver expects theta first, in radians; some files have it last.
  def option(name, {:tuple, numbers}, context, others)
      when name in ~w(mmrad_sonar_poses mrad_sonar_poses) do
    with {:ok, triples} <- triples(numbers),
         {:ok, triples, fewer} <- as_many(triples, sonars(others), "sonars") do
      first = for {angle, x, y} <- triples, do: {x, y, angle}

      case Poses.fit(first: first, last: triples) do
        [:first | _or_last] ->
          sensors(first, :sonars, context, fewer)

        [:last] ->
          why = "read as x, y, theta: so they point away from the middle"
          sensors(triples, :sonars, context, join(why, fewer))

        [] ->
          {:left,
           "neither as theta, x, y nor as x, y, theta, in radians, do they point away from the middle"}
      end
    end
  end

  def option("poses", {:tuple, numbers}, context, others) do
    with {:ok, triples} <- triples(numbers),
         {:ok, triples, fewer} <- as_many(triples, infrareds(others), "infrareds") do
      degrees = for {x, y, angle} <- triples, do: {x, y, {:deg, angle * 1.0}}
      fit = Poses.fit(degrees: degrees, radians: triples)
      boards = if List.keymember?(others, "rflex_banks", 0), do: nil, else: boards(triples)

      case looked(fit, said(context), triples) do
        {:degrees, why} ->
          sensors(degrees, :irs, context, why |> join(fewer) |> join(boards))

        {:radians, why} ->
          sensors(triples, :irs, context, why |> join(fewer) |> join(boards))

        :neither ->
          {:left, "neither in radians nor in degrees do they point away from the middle"}
      end
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
      {:left, "is not a list of pairs a b, a from 1.0e-9 to 1.0e9, b from -10 to 10"}
    end
  end

  # The check of the poses reports a number of poses that differs.
  def option("num_sonars_in_bank", {:tuple, banks}, _context, others) do
    count = value("num_sonars", others)

    cond do
      not Enum.all?(banks, &(is_integer(&1) and &1 in 0..16)) ->
        {:left, "a bank has 0 to 16 sonars"}

      count not in [nil, Enum.sum(banks)] ->
        {:left, "adds up to #{Enum.sum(banks)} sonars, and num_sonars is #{inspect(count)}"}

      true ->
        {:ok, [{[:drive, :sonar_banks], banks}]}
    end
  end

  def option("bumper_count", count, _context, _others) when is_integer(count) do
    if count in 0..16,
      do: {:ok, [{[:body, :bumpers], count} | bumper_count(count)]},
      else: {:left, "0 to 16 bumpers are possible"}
  end

  # The position of a bumper tells which part of the circumference it guards, in whatever units.
  def option("bumper_def", {:tuple, numbers}, _context, others) do
    bumpers = Enum.chunk_every(numbers, 5)

    cond do
      length(bumpers) not in 1..16 or length(bumpers) != value("bumper_count", others) ->
        {:left, "is not five numbers for each of the bumper_count bumpers"}

      not Enum.all?(bumpers, &bumper?/1) ->
        {:left, "is not x, y, theta, length and radius of each, x and y off the middle"}

      true ->
        segments = for [x, y | _] <- bumpers, do: segment(:math.atan2(y, x))
        {:ok, [{[:drive, :bumpers, :segments], segments}]}
    end
  end

  def option("rflex_bumper_style", style, _context, _others) when style in ["bit", "addr"] do
    ours = if style == "bit", do: :bit, else: :address
    {:ok, [{[:drive, :bumpers, :style], ours}]}
  end

  def option("rflex_bumper_address", base, _context, _others) when base in 0..255,
    do: {:ok, [{[:drive, :bumpers, :base], base}]}

  def option("num_sonars", count, _context, _others) when is_integer(count) and count > 0,
    do: :used

  # Player's driver uses the boards.
  def option("pose_count", count, _context, others) when is_integer(count) do
    case infrareds(others) do
      {^count, _name} -> :used
      nil -> :used
      {boards, name} -> {:left, "#{name} adds up to #{boards}, and that counts"}
    end
  end

  def option("num_sonars_possible_per_bank", stride, _context, _others) when stride in 1..16,
    do: {:ok, [{[:drive, :sonar_stride], stride}]}

  def option("sonar_age", age, _context, _others) when age in 1..20,
    do: {:ok, [{[:drive, :sonar_age], age}]}

  # Three options of Player's are one of ours; Player combines them.
  def option("sonar_" <> delay, us, _context, _others)
      when delay in ~w(echo_delay ping_delay set_delay) and us in 0..1_000_000,
      do: {:ok, [{[:drive, :sonar_times, time(delay)], us}]}

  def option("rflex_banks", {:tuple, banks}, _context, _others) do
    if Enum.all?(banks, &(is_integer(&1) and &1 in 0..8)) and length(banks) <= 8,
      do: {:ok, [{[:drive, :ir_banks], banks}]},
      else: {:left, "a board has 0 to 8 infrareds, and there are 8 boards"}
  end

  def option("rflex_base_bank", bank, _context, _others) when bank in 0..7,
    do: {:ok, [{[:drive, :ir_base_bank], bank}]}

  def option("ir_min_range", range, context, _others) when is_number(range) and range >= 0,
    do: Units.told(Units.length_m(range, context), &[{[:drive, :ir_min], &1}])

  def option(name, _value, _context, _others)
      when name in ~w(max_num_sonars num_sonar_banks rflex_bank_count),
      do: :used

  def option(_name, _value, _context, _others), do: nil

  defp bumper?([x, y, _, _, _] = numbers),
    do: Enum.all?(numbers, &is_number/1) and (x != 0 or y != 0)

  defp bumper?(_other), do: false

  # Sixteen of them, the first in front, counter-clockwise.
  defp segment(direction), do: Integer.mod(round(direction / (:math.pi() / 8)), 16)

  defp bumper_count(0), do: []
  defp bumper_count(count), do: [{[:drive, :bumpers, :count], count}]

  defp time("echo_delay"), do: :echo
  defp time("ping_delay"), do: :ping
  defp time("set_delay"), do: :set

  defp sensors(places, key, context, assumed) do
    places = for {x, y, angle} <- places, do: {x, y, Poses.angle(angle)}
    {places, more} = Units.places(places, context)
    Units.told({places, join(assumed, more)}, &[{[:body, key], &1}])
  end

  # Player's driver reads as many as there are sensors, beginning with the first.
  defp as_many(triples, nil, _sensors), do: {:ok, triples, nil}

  defp as_many(triples, {count, name}, sensors) do
    case length(triples) do
      ^count ->
        {:ok, triples, nil}

      more when more > count ->
        why = "the first #{count} of #{more} poses are taken, as many #{sensors} as #{name} says"
        {:ok, Enum.take(triples, count), why}

      fewer ->
        {:left, "there are poses for #{fewer} #{sensors}, and #{name} says #{count}"}
    end
  end

  defp sonars(others) do
    case total("num_sonars_in_bank", others) || value("num_sonars", others) do
      {count, name} when is_integer(count) -> {count, name}
      count when is_integer(count) -> {count, "num_sonars"}
      _not_a_number -> nil
    end
  end

  defp infrareds(others), do: total("rflex_banks", others)

  defp total(name, others) do
    with {:tuple, banks} <- value(name, others),
         true <- Enum.all?(banks, &is_integer/1),
         do: {Enum.sum(banks), name},
         else: (_none -> nil)
  end

  defp value(name, others) do
    with {_name, _line, value} <- List.keyfind(others, name, 0), do: value
  end

  # The older driver uses degrees; the newer one documents degrees but reads radians.
  defp said(%{version: 1}), do: :degrees
  defp said(%{unit_angle: unit}), do: unit

  defp looked([], _said, _triples), do: :neither

  defp looked(fit, nil, triples) do
    beyond? = Enum.any?(triples, fn {_x, _y, angle} -> not Units.radians?(angle) end)

    case {fit, beyond?} do
      {[:radians], false} ->
        {:radians, nil}

      {[:radians], true} ->
        {:radians, "angles taken for radians, some of them beyond a turn: #{so()}"}

      {[:degrees], _beyond} ->
        {:degrees, "angles taken for degrees: #{so()}"}

      {_both, true} ->
        {:degrees, "angles taken for degrees: in radians they would be more than a turn"}

      {_both, false} ->
        {:radians, nil}
    end
  end

  defp looked(fit, said, _triples) do
    if said in fit,
      do: {said, nil},
      else: {hd(fit), "angles taken for #{hd(fit)}, not for #{said}: #{so()}"}
  end

  defp so, do: "so they point away from the middle"

  defp boards(triples) do
    count = length(triples)
    "no rflex_banks are given: taken for boards of 8, #{count} infrareds in all"
  end

  defp triples(numbers) do
    if Enum.all?(numbers, &is_number/1) and rem(length(numbers), 3) == 0 and numbers != [],
      do: {:ok, numbers |> Enum.chunk_every(3) |> Enum.map(&List.to_tuple/1)},
      else: {:left, "is not a list of three numbers for each sensor"}
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
