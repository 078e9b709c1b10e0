defmodule Sim.Scenario.Check.Bodies do
  @moduledoc false
  # Judges expectations about bodies by their true poses and speeds. Pure; answers are those of
  # `Sim.Scenario.Check`.
  alias Hal.Pose
  alias Sim.Scenario.{Check, Expectation, View}

  # Slower is not driving: a robot that keeps its place creeps.
  @moving_m_s 0.05

  @doc "The answer at this tick; `memory` is what the last one returned, at first `nil`."
  @spec judge(Expectation.t(), View.t(), memory :: term()) :: Check.answer()
  def judge({:at, robot, place, by}, view, nearest) do
    away = Pose.distance(View.pose(view, robot), place)
    # An atom is greater than any number.
    nearest = min(nearest, away)
    {:reach, away <= by[:within_m], "#{m(nearest)} away at the nearest", nearest}
  end

  def judge({:in_slot, who, by}, view, _) do
    errors = View.slot_errors(view, View.who(view, who))
    so? = errors != [] and Enum.all?(errors, fn {_id, e} -> e != nil and e <= by[:within_m] end)
    {:reach, so?, off(errors), nil}
  end

  def judge({:still, who, _window}, view, _) do
    robots = if who == :all, do: view.options.robots, else: [who]

    moving = for id <- robots, {v, w} = View.speed(view, id), v != 0.0 or w != 0.0, do: {id, v, w}

    {:keep, moving == [], if(moving == [], do: "all still", else: speeds(moving)), nil}
  end

  def judge({:moves, who, _by}, view, moved) do
    robots = View.who(view, who)
    now = for id <- robots, {v, _w} = View.speed(view, id), abs(v) > @moving_m_s, do: id
    moved = Enum.uniq((moved || []) ++ now)
    left = robots -- moved
    figures = if left == [], do: "each did", else: "not #{Enum.join(left, ", ")}"
    {:reach, robots != [] and left == [], figures, moved}
  end

  # Turning is counted from the beginning of the window, and judged at its end: who turns on would
  # pass the right angle.
  def judge({:turned, robot, degrees, by}, view, memory) do
    heading = View.pose(view, robot).heading
    {last, sum} = memory || {heading, 0.0}
    sum = sum + Pose.relative(Pose.new(0, 0, last), Pose.new(0, 0, heading)).heading
    turned = sum * 180 / :math.pi()
    right? = abs(turned - degrees) <= by[:within_deg]
    over? = View.at_s(view) >= by[:by_s]
    {:reach, right? and over?, "#{Float.round(turned, 1)} degrees", {heading, sum}}
  end

  def judge({:sees_distance, robot, options}, view, seen) do
    case View.distance(view, robot) do
      nil ->
        over? = options[:to_s] != nil and View.at_s(view) >= options[:to_s]
        {:keep, seen != nil or not over?, seen || "it does not see the landmark", seen}

      {measured, real} ->
        off = abs(measured - real) / real * 100
        figures = "measures #{m(measured)} where it is #{m(real)}"
        {:keep, off <= options[:within_percent], figures, figures}
    end
  end

  def judge({:speed_at_most, most}, view, fastest), do: speed(most, view, fastest)
  def judge({:speed_at_most, most, _window}, view, fastest), do: speed(most, view, fastest)

  def judge({:separation_at_least, least}, view, _) do
    near = view.world.min_separation

    {:keep, near == nil or near >= least,
     "#{if near, do: m(near), else: "nobody"} at the nearest", nil}
  end

  defp speed(most, view, fastest) do
    speeds = for id <- view.options.robots, {v, w} = View.speed(view, id), do: {abs(v), id, v, w}

    fastest = Enum.max([fastest || {0.0, hd(view.options.robots), 0.0, 0.0} | speeds])
    {top, id, v, w} = fastest
    # Rounding of the last bits is not speed.
    {:keep, top <= most + 1.0e-9, "at most " <> speeds([{id, v, w}]), fastest}
  end

  defp off([]), do: "nobody has a slot"

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
