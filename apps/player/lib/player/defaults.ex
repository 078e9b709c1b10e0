defmodule Player.Defaults do
  @moduledoc """
  Values derived from several of Player's options or from its defaults: what its driver does by
  default, what one value implies for another, what does not fit the body. Pure.

  The state is that of `Player`: values with the line and name of the option they came from,
  what was assumed, what is left out.
  """
  alias Hal.Profile

  @type entry :: {path :: [atom()], value :: term(), line :: pos_integer(), option :: String.t()}
  @type t :: %{
          values: [entry()],
          assumed: [Player.remark()],
          left: [Player.remark()],
          seen: [atom()]
        }

  @echo_us 30_000
  # The same as in Robot.File.Odd.
  @slow_s 5.0

  @doc "The value at a path, or `nil`."
  @spec value(t(), [atom()]) :: term()
  def value(state, path) do
    case List.keyfind(state.values, path, 0) do
      {_path, value, _line, _name} -> value
      nil -> nil
    end
  end

  @doc "The kind of robot: the one asked for, or a guess from its sensors and shape."
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

  @doc "Keeps and completes what fits a body of that kind."
  @spec complete(t(), :magellan | :atrv_mini) :: t()
  def complete(state, kind) do
    body = apply(Profile, kind, [])

    state
    |> ported()
    |> timed()
    |> bumped(kind)
    |> placed()
    |> touchless(kind)
    |> circled(body)
    |> limited(body)
  end

  @doc "Adds a remark on something that was assumed."
  @spec assume(t(), pos_integer(), String.t(), String.t()) :: t()
  def assume(state, line, what, why), do: %{state | assumed: [{line, what, why} | state.assumed]}

  @doc "Adds further values that follow from an option in a line."
  @spec keep(t(), pos_integer(), String.t(), [{[atom()], term()}]) :: t()
  def keep(state, line, name, values) do
    new = for {path, value} <- values, do: {path, value, line, name}
    %{state | values: state.values ++ new}
  end

  @doc "Leaves out the values at some paths, and says why."
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

  # Player's own wait for an echo, 3000 us, covers only half a metre; this is an error in its
  # documentation.
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

  # If nothing says where each bumper is, the driver guesses.
  defp placed(state) do
    count = value(state, [:drive, :bumpers, :count])
    address? = value(state, [:drive, :bumpers, :style]) == :address

    if count != nil and address? and value(state, [:drive, :bumpers, :segments]) == nil,
      do:
        assume(
          state,
          1,
          "bumpers",
          "their positions are not known: the first is taken to be in front, the others to follow to the left"
        ),
      else: state
  end

  # An ATRV mini has no bumpers, a Magellan has 16, whether the file says so or not.
  defp touchless(state, :atrv_mini) do
    if value(state, [:body, :bumpers]),
      do: state,
      else: keep(state, 1, "bumpers", [{[:body, :bumpers], 0}])
  end

  defp touchless(state, :magellan), do: state

  # The circle around a body of another size.
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

  # A limit may only be lower than what the body can do; a person should know how it brakes.
  defp limited(state, body) do
    with a when is_number(a) and a >= 0.01 and a < 0.2 <-
           value(state, [:limits, :max_acceleration]) do
      {_, _, line, option} = List.keyfind(state.values, [:limits, :max_acceleration], 0)
      way = Float.round(body.max_linear * body.max_linear / (2 * a), 1)
      why = "taken as it is, but at full speed the robot then needs #{way} m to stop"
      state |> assume(line, option, why) |> turned(body) |> lowered(body)
    else
      _well -> state |> turned(body) |> lowered(body)
    end
  end

  # Player's driver uses an acceleration of its own for turns, whatever the file says.
  defp turned(state, body) do
    case value(state, [:limits, :max_turn_acceleration]) do
      a when is_number(a) and a > 0 and body.max_turn / a > @slow_s ->
        seconds = round(body.max_turn / a)

        why =
          "with #{a} rad/s2 it would take #{seconds} s to reach full turn speed; " <>
            "Player does not use it, and #{body.max_turn_acceleration} is usual"

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
          "#{value} is not between 0.01 and #{most}, the range of a #{body.name}"
        )
    end
  end
end
