defmodule Robot.Player.Whole do
  @moduledoc """
  What of a robot file's values no single option of Player's can say: what its driver does unless
  told otherwise, what one value means for another, what does not fit the body. Pure.

  The state is that of `Robot.Player`: values with the line and name of the option they came from,
  what was assumed, what is left out.
  """
  alias Hal.Profile

  @type entry :: {path :: [atom()], value :: term(), line :: pos_integer(), option :: String.t()}
  @type t :: %{
          values: [entry()],
          assumed: [Robot.Player.remark()],
          left: [Robot.Player.remark()],
          seen: [atom()]
        }

  @echo_us 30_000
  # As Robot.File.Odd has it.
  @slow_s 5.0

  @doc "The value at a path, or nil."
  @spec value(t(), [atom()]) :: term()
  def value(state, path) do
    case List.keyfind(state.values, path, 0) do
      {_path, value, _line, _name} -> value
      nil -> nil
    end
  end

  @doc "The kind of robot: as asked for, or guessed by its sensors and shape."
  @spec profile(t(), :magellan | :atrv_mini | nil) :: {:magellan | :atrv_mini, t()}
  def profile(state, nil) do
    touches? = value(state, [:body, :irs]) != nil or (value(state, [:body, :bumpers]) || 0) > 0

    cond do
      touches? ->
        {:magellan, assume(state, 1, "profile: :magellan", "guessed: it has bumpers or infrared")}

      value(state, [:body, :length]) != value(state, [:body, :width]) ->
        why = "guessed: it is not as long as wide, and has neither bumpers nor infrared"
        {:atrv_mini, assume(state, 1, "profile: :atrv_mini", why)}

      true ->
        {:magellan, assume(state, 1, "profile: :magellan", "guessed: it is as long as wide")}
    end
  end

  def profile(state, profile), do: {profile, state}

  @doc "All that fits a body of that kind."
  @spec complete(t(), :magellan | :atrv_mini) :: t()
  def complete(state, kind) do
    body = apply(Profile, kind, [])

    state
    |> ported()
    |> timed()
    |> bumped(kind)
    |> placed()
    |> banked(body)
    |> ringed(body)
    |> touchless(kind)
    |> circled(body)
    |> limited(body)
  end

  # What cannot be guessed: which sensor is where. A robot drives by them.
  @sensors ~w(mmrad_sonar_poses mrad_sonar_poses num_sonars num_sonars_in_bank
              num_sonars_possible_per_bank poses rflex_banks rflex_base_bank)

  @doc """
  Whether all that the file says of sonars and infrareds came over. If not, which line did not, and why: a robot
  whose sensors are elsewhere than it thinks is worse than none.
  """
  @spec sure(t()) :: :ok | {:error, {line :: pos_integer(), why :: String.t()}}
  def sure(state) do
    case Enum.sort(for {_, name, _} = remark <- state.left, name in @sensors, do: remark) do
      [] -> :ok
      [{line, name, why} | _more] -> {:error, {line, "#{name}: #{why}"}}
    end
  end

  @doc "A remark on what was taken for granted."
  @spec assume(t(), pos_integer(), String.t(), String.t()) :: t()
  def assume(state, line, what, why), do: %{state | assumed: [{line, what, why} | state.assumed]}

  @doc "Further values that come of an option in a line."
  @spec keep(t(), pos_integer(), String.t(), [{[atom()], term()}]) :: t()
  def keep(state, line, name, values) do
    new = for {path, value} <- values, do: {path, value, line, name}
    %{state | values: state.values ++ new}
  end

  @doc "Leaves out what came of some paths, and says why."
  @spec leave(t(), (entry() -> boolean()), String.t()) :: t()
  def leave(state, which, why) do
    {gone, values} = Enum.split_with(state.values, which)
    left = for {_path, _value, line, option} <- gone, do: {line, option, why}
    %{state | values: values, left: Enum.uniq(left) ++ state.left}
  end

  defp ported(state) do
    for {kind, path, port} <- [
          {:drive, [:drive, :port], "/dev/ttyR0"},
          {:ptz, [:ptz, :port], "/dev/ttyS2"},
          {:camera, [:camera, :source], "/dev/video0"}
        ],
        kind in state.seen and value(state, path) == nil,
        reduce: state do
      state ->
        state
        |> assume(1, "#{kind}", "no port is given; #{port} is Player's")
        |> keep(1, "port", [{path, port}])
    end
  end

  # Player's own wait for an echo, 3000 us, hears half a metre; it is a slip of its documentation.
  defp timed(state) do
    case for {[:drive, :sonar_times, name], us, _, _} <- state.values, do: {name, us} do
      [] ->
        state

      times ->
        {old, values} =
          Enum.split_with(state.values, &match?({[:drive, :sonar_times, _], _, _, _}, &1))

        [{_, _, line, option} | _] = old
        echo = if (times[:echo] || 0) > 0, do: times[:echo], else: @echo_us
        times = {echo, times[:ping] || 0, times[:set] || 0}
        keep(%{state | values: values}, line, option, [{[:drive, :sonar_times], times}])
    end
  end

  defp bumped(state, kind) do
    count = value(state, [:drive, :bumpers, :count])

    cond do
      count == nil or value(state, [:drive, :bumpers, :style]) != nil ->
        state

      kind == :magellan and count == 16 ->
        state
        |> assume(1, "bumpers", "no style is given; those of a Magellan Pro are bits")
        |> keep(1, "bumpers", [{[:drive, :bumpers, :style], :bit}])

      true ->
        keep(state, 1, "bumpers", [{[:drive, :bumpers, :style], :address}])
    end
  end

  # Which bumper is where, when nothing says it, is the driver's guess.
  defp placed(state) do
    count = value(state, [:drive, :bumpers, :count])
    address? = value(state, [:drive, :bumpers, :style]) == :address

    if count != nil and address? and value(state, [:drive, :bumpers, :segments]) == nil,
      do:
        assume(
          state,
          1,
          "bumpers",
          "no bumper_def is given: the first is taken for the front's, then to the left"
        ),
      else: state
  end

  # Our profile's sonars are there when the file has no poses.
  defp banked(state, body) do
    banks = value(state, [:drive, :sonar_banks])
    sonars = value(state, [:body, :sonars])
    count = length(sonars || body.sonars)

    cond do
      banks == nil and sonars != nil and rem(count, 8) != 0 ->
        {_, _, line, _option} = List.keyfind(state.values, [:body, :sonars], 0)

        why = "is not given: taken for boards of 8, #{count} sonars in all"
        assume(state, line, "num_sonars_in_bank", why)

      banks == nil or (sonars != nil and Enum.sum(banks) == count) ->
        state

      Enum.sum(banks) == count ->
        {_, _, line, option} = List.keyfind(state.values, [:drive, :sonar_banks], 0)
        assume(state, line, option, "no poses are given: those of a #{body.name} are taken")

      true ->
        why =
          "adds up to #{Enum.sum(banks)} sonars, and there are no poses; a #{body.name} has #{count}"

        leave(state, &match?({[:drive, :sonar_banks], _, _, _}, &1), why)
    end
  end

  # Player's poses are in the order of the reports, unlike those of our profile.
  defp ringed(state, body) do
    case value(state, [:body, :irs]) do
      nil ->
        unplaced(state, value(state, [:drive, :ir_banks]), body)

      irs ->
        state =
          keep(state, 1, "poses", [{[:drive, :ir_order], Enum.to_list(0..(length(irs) - 1))}])

        state |> boarded(length(irs)) |> calibrated(length(irs))
    end
  end

  defp unplaced(state, nil, _body), do: state

  defp unplaced(state, banks, body) do
    if Enum.sum(banks) == length(body.irs) do
      {_, _, line, option} = List.keyfind(state.values, [:drive, :ir_banks], 0)
      assume(state, line, option, "no poses are given: those of a #{body.name} are taken")
    else
      why = "adds up to #{Enum.sum(banks)} infrareds, and there are no poses of them"
      leave(state, &match?({[:drive, :ir_banks], _, _, _}, &1), why)
    end
  end

  defp boarded(state, irs) do
    banks = value(state, [:drive, :ir_banks])

    cond do
      banks == nil ->
        keep(state, 1, "poses", [{[:drive, :ir_banks], boards(irs)}])

      Enum.sum(banks) == irs ->
        state

      true ->
        state
        |> leave(&match?({[:drive, :ir_banks], _, _, _}, &1), "is not for #{irs} infrareds")
        |> boarded(irs)
    end
  end

  defp boards(irs) when irs <= 8, do: [irs]
  defp boards(irs), do: [8 | boards(irs - 8)]

  defp calibrated(state, irs) do
    case value(state, [:drive, :conversions, :ir_a]) do
      as when is_list(as) and length(as) != irs ->
        calibration? =
          &match?({[:drive, :conversions, name], _, _, _} when name in [:ir_a, :ir_b], &1)

        leave(state, calibration?, "is for #{length(as)} infrareds, not for #{irs}")

      _one_or_none ->
        state
    end
  end

  # An ATRV mini has no bumpers, a Magellan has 16, whether Player was told or not.
  defp touchless(state, :atrv_mini) do
    if value(state, [:body, :bumpers]),
      do: state,
      else: keep(state, 1, "bumpers", [{[:body, :bumpers], 0}])
  end

  defp touchless(state, :magellan), do: state

  # The circle round a body of another size.
  defp circled(state, body) do
    length = value(state, [:body, :length]) || body.length
    width = value(state, [:body, :width]) || body.width

    cond do
      {length, width} == {body.length, body.width} ->
        state

      body.name == :magellan ->
        keep(state, 1, "radius", [{[:body, :radius], Float.round(max(length, width) / 2, 3)}])

      true ->
        radius = Float.round(:math.sqrt(length * length + width * width) / 2, 3)
        keep(state, 1, "radius", [{[:body, :radius], radius}])
    end
  end

  # A limit may only be lower than what the body can do; how it brakes, a person should know.
  defp limited(state, body) do
    with a when is_number(a) and a >= 0.01 and a < 0.2 <-
           value(state, [:limits, :max_acceleration]) do
      {_, _, line, option} = List.keyfind(state.values, [:limits, :max_acceleration], 0)
      way = Float.round(body.max_linear * body.max_linear / (2 * a), 1)
      why = "taken as it is, but at full speed it then needs #{way} m to stand"
      state |> assume(line, option, why) |> turned(body) |> lowered(body)
    else
      _well -> state |> turned(body) |> lowered(body)
    end
  end

  # Player's driver turns with an acceleration of its own, whatever the file says.
  defp turned(state, body) do
    case value(state, [:limits, :max_turn_acceleration]) do
      a when is_number(a) and a > 0 and body.max_turn / a > @slow_s ->
        seconds = round(body.max_turn / a)

        why =
          "with #{a} rad/s2 it would take #{seconds} s to turn at full speed; " <>
            "Player does not drive by it, and #{body.max_turn_acceleration} is usual"

        leave(state, &match?({[:limits, :max_turn_acceleration], _, _, _}, &1), why)

      _usual ->
        state
    end
  end

  defp lowered(state, body) do
    for {[:limits, name] = path, value, _line, _option} <- state.values,
        most = Map.fetch!(body, name),
        value > most or value < 0.01,
        reduce: state do
      state ->
        leave(
          state,
          &(elem(&1, 0) == path),
          "#{value} is not between 0.01 and #{most}, what a #{body.name} can do"
        )
    end
  end
end
