defmodule Player.Defaults do
  @moduledoc """
  Values derived from several of Player's options or from its defaults: what its driver does by
  default, what one value implies for another, what does not fit the body. Pure.
  """
  import Player.State
  alias Hal.Profile
  alias Player.State
  alias Robot.File.Bodies

  @echo_us 30_000
  # The same as in Robot.File.Warnings.
  @slow_s 5.0

  @doc "The kind of robot: the one asked for, or a guess from its sensors and shape."
  @spec profile(State.t(), body :: atom() | nil) :: {body :: atom(), State.t()}
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
  @spec complete(State.t(), body :: atom()) :: State.t()
  def complete(state, kind) do
    {:ok, body} = Bodies.fetch(kind)

    state
    |> ported()
    |> timed()
    |> bumped(body)
    |> placed()
    |> touchless(body)
    |> circled(body)
    |> limited(body)
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
    |> parted()
  end

  # Both on one line is a slip in the file; the base stays.
  defp parted(state) do
    port = value(state, [:ptz, :port])

    if port != nil and port == value(state, [:drive, :port]),
      do:
        leave(
          state,
          &match?({[:ptz | _], _, _, _}, &1),
          "the camera's head is on the base's line, #{port}"
        ),
      else: state
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

  defp bumped(state, body) do
    count = value(state, [:drive, :bumpers, :count])

    cond do
      count == nil or value(state, [:drive, :bumpers, :style]) != nil ->
        state

      body.rflex == :magellan and count == 16 ->
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
  defp touchless(state, %{rflex: :atrv_mini}) do
    if value(state, [:body, :bumpers]),
      do: state,
      else: keep(state, 1, "bumpers", [{[:body, :bumpers], 0}])
  end

  defp touchless(state, _body), do: state

  # The circle around a body of another size.
  defp circled(state, body) do
    length = value(state, [:body, :length]) || body.length
    width = value(state, [:body, :width]) || body.width

    across =
      if Profile.round?(body),
        do: max(length, width),
        else: :math.sqrt(length * length + width * width)

    if {length, width} == {body.length, body.width},
      do: state,
      else: keep(state, 1, "radius", [{[:body, :radius], Float.round(across / 2, 3)}])
  end

  # A limit may only be lower than what the body can do; a person should know how it brakes.
  defp limited(state, body) do
    with a when is_number(a) and a >= 0.01 and a < 0.2 <-
           value(state, [:limits, :max_acceleration]) do
      way = Float.round(body.max_linear * body.max_linear / (2 * a), 1)
      why = "taken as it is, but at full speed the robot then needs #{way} m to stop"
      state |> assume([:limits, :max_acceleration], why) |> turned(body) |> lowered(body)
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

        leave(state, [[:limits, :max_turn_acceleration]], why)

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
          [path],
          "#{value} is not between 0.01 and #{most}, the range of a #{body.name}"
        )
    end
  end
end
