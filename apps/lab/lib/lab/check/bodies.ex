defmodule Lab.Check.Bodies do
  @moduledoc false
  # Judges expectations about bodies by their true poses and speeds. Pure; answers are those of
  # `Lab.Check.Kind`.
  @behaviour Lab.Check.Kind
  alias Hal.Pose
  alias Lab.Moment
  alias Sim.{Scene, World}
  alias Lab.Trial.{Evaluation, RunLog}

  # Slower is not driving: a robot that keeps its place creeps.
  @moving_m_s 0.05

  @impl Lab.Check.Kind
  def new(_options), do: nil

  @impl Lab.Check.Kind
  def note({:at, robot, place, by}, moment, nearest) do
    away = Pose.distance(World.truth(moment.world, robot), place)
    # An atom is greater than any number.
    nearest = min(nearest, away)
    {:reach, away <= by[:within_m], "#{m(nearest)} away at the nearest", nearest}
  end

  def note({:in_slot, who, by}, moment, _) do
    errors = slot_errors(moment, Moment.who(moment, who))
    so? = errors != [] and Enum.all?(errors, fn {_id, e} -> e != nil and e <= by[:within_m] end)
    {:reach, so?, off(errors), nil}
  end

  def note({:still, who, _window}, moment, _) do
    robots = if who == :all, do: moment.options.robots, else: [who]

    moving =
      for id <- robots,
          {v, w} = moment.world.robots[id].speed,
          v != 0.0 or w != 0.0,
          do: {id, v, w}

    {:keep, moving == [], if(moving == [], do: "all still", else: speeds(moving)), nil}
  end

  def note({:moves, who, _by}, moment, moved) do
    robots = Moment.who(moment, who)
    now = for id <- robots, {v, _w} = moment.world.robots[id].speed, abs(v) > @moving_m_s, do: id
    moved = Enum.uniq((moved || []) ++ now)
    left = robots -- moved
    figures = if left == [], do: "each did", else: "not #{Enum.join(left, ", ")}"
    {:reach, robots != [] and left == [], figures, moved}
  end

  # Turning is counted from the beginning of the window, and judged at its end: who turns on would
  # pass the right angle.
  def note({:turned, robot, degrees, by}, moment, memory) do
    heading = World.truth(moment.world, robot).heading
    {last, sum} = memory || {heading, 0.0}
    sum = sum + Pose.relative(Pose.new(0, 0, last), Pose.new(0, 0, heading)).heading
    turned = sum * 180 / :math.pi()
    right? = abs(turned - degrees) <= by[:within_deg]
    over? = Moment.at_s(moment) >= by[:by_s]
    {:reach, right? and over?, "#{Float.round(turned, 1)} degrees", {heading, sum}}
  end

  def note({:sees_distance, robot, options}, moment, seen) do
    case distance(moment, robot) do
      nil ->
        over? = options[:to_s] != nil and Moment.at_s(moment) >= options[:to_s]
        {:keep, seen != nil or not over?, seen || "it does not see the landmark", seen}

      {measured, real} ->
        off = abs(measured - real) / real * 100
        figures = "measures #{m(measured)} where it is #{m(real)}"
        {:keep, off <= options[:within_percent], figures, figures}
    end
  end

  def note({:speed_at_most, most, _window}, moment, fastest) do
    speeds =
      for id <- moment.options.robots,
          {v, w} = moment.world.robots[id].speed,
          do: {abs(v), id, v, w}

    fastest = Enum.max([fastest || {0.0, hd(moment.options.robots), 0.0, 0.0} | speeds])
    {top, id, v, w} = fastest
    # Rounding of the last bits is not speed.
    {:keep, top <= most + 1.0e-9, "at most " <> speeds([{id, v, w}]), fastest}
  end

  def note({:separation_at_least, least}, moment, _) do
    near = moment.world.min_separation

    {:keep, near == nil or near >= least,
     "#{if near, do: m(near), else: "nobody"} at the nearest", nil}
  end

  # Of living robots; `nil` for one without a slot.
  defp slot_errors(moment, robots) do
    run = Map.take(moment, [:at_ms, :options, :world, :run_log])
    # The body of a frozen robot stands where it stood.
    frozen = for {id, :frozen} <- moment.doing, do: {id, %{phase: :frozen}}
    more = %{claims: Map.new(frozen ++ moment.claims), messages: %{sent: 0, lost: 0}}
    scene = run |> Map.merge(more) |> Evaluation.scene()

    for %{id: id, leader?: false} = robot <- scene.robots,
        id in robots,
        do: {id, if(robot.alive, do: Scene.slot_error(robot))}
  end

  # The distance to the landmark that a robot measures, and the true one, in metres; or `nil`.
  defp distance(%{world: %{landmark: landmark}} = moment, robot) do
    with {_id, claim} <- List.keyfind(moment.claims, robot, 0),
         %{sight: %{distance: millimetres}} when millimetres != nil and landmark != nil <-
           RunLog.account(moment.run_log, claim),
         do: {millimetres / 1000, Pose.distance(World.truth(moment.world, robot), landmark)},
         else: (_does_not_see -> nil)
  end

  defp off([]), do: "no robot has a slot"

  defp off(errors) do
    Enum.map_join(errors, ", ", fn
      {id, nil} -> "#{id} has no slot"
      {id, metres} -> "#{id} #{m(metres)} off"
    end)
  end

  defp speeds(moving) do
    Enum.map_join(moving, ", ", fn {id, v, w} ->
      "#{id} at #{Float.round(v, 3)} m/s and #{Float.round(w, 3)} rad/s"
    end)
  end

  defp m(metres), do: "#{Float.round(metres * 1.0, 2)} m"
end
