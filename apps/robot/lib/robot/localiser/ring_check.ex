defmodule Robot.Localiser.RingCheck do
  @moduledoc """
  Measures the slip of a robot's wheels by its sonars, while it turns on the spot: what the ring of sonars hears in a direction at the
  beginning of the turn, other sonars of it hear there at the end. Pure.

  Each echo is a direction and a distance from the middle of the body. The echoes of the first 0.45 rad are a table of distances by
  direction. For each slip that is tried, the later echoes are put where they would have come from, and compared with the table; the
  slip with the least mean difference is that of the wheels, if others are clearly worse. A robot that stands among walls knows its
  slip to 0.003 after a full turn, for any floor plan or none; one that hears little or the same all around learns nothing.
  """
  alias Hal.Pose
  alias Robot.Localiser.Belief
  alias Robot.Percept

  # A robot that moves farther than this (metres) hears other walls.
  @same_place 0.05
  # A ring is taken each time that it has turned so far (radians); the table has those of the first so many.
  @apart 0.03
  @first 0.45
  # The measurement is made when it stands after so much turning, or after a full turn, and then begins anew.
  @least_turn 5.0
  @full_turn 2 * :math.pi()
  @standing 0.05
  # Every second ring counts from this turn on, where slip shows.
  @shows 1.0
  # Ranges between these (metres) count as echoes.
  @near 0.2
  @far 4.4
  # The table's directions; differences count up to this (metres).
  @bins 120
  @most 0.4
  # The slips that are tried: so many to each side, so far apart.
  @tried 24
  @step 0.005
  # A measurement needs so many echoes that compare, and that slips off by eight steps fit so much worse.
  @echoes 150
  @aside 8
  @worse 1.5
  # Its standard deviation (radians), also for each radian turned.
  @sd 0.006
  @sd_per_radian 0.002

  @enforce_keys [:pose, :heading, :at, :sonar]
  defstruct @enforce_keys ++ [turned: 0.0, taken: 0.0, rings: []]

  @typedoc """
  `pose` is where the turn began, `heading` the last heading, both by odometry; `at` is how far it has turned to the left (radians),
  `turned` the sum of all angles, `taken` that at the last ring. `rings` are the turns to the left and the sums at which its echoes
  were heard, and these: directions from the body and distances; the newest first. `sonar` are the last ranges.
  """
  @type t :: %__MODULE__{
          pose: Pose.t(),
          heading: float(),
          at: float(),
          sonar: [float()],
          turned: float(),
          taken: float(),
          rings: [
            {at :: float(), turned :: float(), [{direction :: float(), distance :: float()}]}
          ]
        }

  @doc "The check and the belief after one percept."
  @spec hear(t() | nil, Belief.t(), Percept.t()) :: {t() | nil, Belief.t()}
  def hear(check, belief, %Percept{sonar: nil}), do: {check, belief}
  def hear(nil, belief, percept), do: {begin(percept), belief}

  def hear(check, belief, %Percept{odometry: %{pose: now, twist: twist}} = percept) do
    step = Pose.wrap(now.heading - check.heading)
    check = %{check | heading: now.heading, at: check.at + step, turned: check.turned + abs(step)}

    cond do
      Pose.distance(check.pose, Pose.point(now)) > @same_place ->
        {begin(percept), belief}

      check.turned >= @full_turn or
          (check.turned >= @least_turn and abs(twist.turn) < @standing) ->
        {begin(percept), measured(belief, check)}

      check.turned - check.taken >= @apart and percept.sonar != check.sonar ->
        {take(check, percept), belief}

      true ->
        {check, belief}
    end
  end

  defp begin(%{odometry: %{pose: pose}} = percept) do
    take(%__MODULE__{pose: pose, heading: pose.heading, at: 0.0, sonar: percept.sonar}, percept)
  end

  defp take(check, %{profile: profile, sonar: ranges}) do
    echoes =
      for {mount, range} <- Enum.zip(profile.sonars, ranges),
          is_number(range) and range > @near and range < min(@far, profile.sonar_max),
          do: polar(Pose.compose(mount, Pose.new(range, 0.0)))

    rings = [{check.at, check.turned, echoes} | check.rings]
    %{check | rings: rings, taken: check.turned, sonar: ranges}
  end

  defp polar(%Pose{x: x, y: y}), do: {:math.atan2(y, x), :math.sqrt(x * x + y * y)}

  defp measured(belief, %{turned: turned} = check) do
    sd = @sd + @sd_per_radian * turned

    case slip(Enum.reverse(check.rings)) do
      nil -> belief
      slip -> Belief.turned(belief, slip * turned, turned, sd * sd)
    end
  end

  @doc """
  The slip by these rings (`t:t/0`, the oldest first): by which share of the sum of its angles the robot has turned farther to the
  left than by odometry. `nil` if none is clearly the right one.
  """
  @spec slip([{float(), float(), [{float(), float()}]}]) :: float() | nil
  def slip(rings) do
    {first, later} = Enum.split_while(rings, fn {_at, turned, _echoes} -> turned <= @first end)
    table = table(first)
    later = later |> Enum.drop_while(&(elem(&1, 1) < @shows)) |> Enum.take_every(2)
    echoes = for {at, turned, echoes} <- later, e <- echoes, do: {at, turned, e}
    fits = for k <- -@tried..@tried, do: {fit(k * @step, echoes, table), k}
    {least, best} = Enum.min(fits)

    if least != :few and abs(best) < @tried and
         Enum.all?([best - @aside, best + @aside], &clearly?(fits, &1, least)),
       do: @step * (best + vertex(for k <- -1..1, do: at(fits, best + k)))
  end

  # Distances that were heard in a direction, in the mean.
  defp table(rings) do
    for {at, _turned, echoes} <- rings, {direction, distance} <- echoes, reduce: %{} do
      table ->
        Map.update(table, bin(direction + at), {distance, 1}, fn {sum, n} ->
          {sum + distance, n + 1}
        end)
    end
    |> Map.new(fn {bin, {sum, n}} -> {bin, sum / n} end)
  end

  # The mean difference, `:few` (which is more than any number) where few echoes compare.
  defp fit(slip, echoes, table) do
    {sum, n} =
      for {at, turned, {direction, distance}} <- echoes,
          known = table[bin(direction + at + slip * turned)],
          reduce: {0.0, 0},
          do: ({sum, n} -> {sum + min(abs(distance - known), @most), n + 1})

    if n >= @echoes, do: sum / n, else: :few
  end

  defp bin(angle), do: Integer.mod(round(angle / (2 * :math.pi()) * @bins), @bins)

  # Beyond what was tried the nearest one that was counts. Where few echoes compare, nothing is clear.
  defp clearly?(fits, k, least) do
    fit = at(fits, k)
    is_float(fit) and fit > @worse * least
  end

  defp at(fits, k), do: fits |> Enum.at(min(max(k + @tried, 0), 2 * @tried)) |> elem(0)

  # Where between the steps the parabola through three neighbours has its least value.
  defp vertex([before, least, next])
       when is_float(before) and is_float(next) and before + next > 2 * least,
       do: 0.5 * (before - next) / (before - 2 * least + next)

  defp vertex(_flat), do: 0.0
end
