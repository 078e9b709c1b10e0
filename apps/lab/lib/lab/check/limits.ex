defmodule Lab.Check.Limits do
  @moduledoc """
  Judges what robots tell their wheels, and how they truly moved, by their profiles. Pure; fed every
  100 ms, which are two steps of the reflexes.

  | invariant | what must hold |
  |---|---|
  | `too_fast` | no wanted speed or turn above the profile's; no true way above its speed |
  | `too_abrupt` | a speed grows by at most the profile's acceleration, and shrinks by at most twice that; a stop is at once (`Robot.Safety.Reflex`) |
  | `stop_ignored` | while a stop holds a robot, it wants to stand; 2 s later it stands |

  A robot that a person has lifted did not drive there.

  2 s: at half a metre a second and half a metre a second squared a base needs 1 s, and 0.1 s of lag
  for each factor e down to a tenth of a millimetre a second.
  """
  @behaviour Lab.Check.Kind
  alias Lab.Check.Violation

  @tick_s 0.1
  @slack 1.0e-6
  @brake_ms 2_000
  @still_m 1.0e-3

  defstruct before: %{}, held: %{}

  @type t :: %__MODULE__{
          before: %{atom() => {Hal.Twist.t(), Hal.Pose.t()}},
          held: %{atom() => integer()}
        }

  @impl Lab.Check.Kind
  def new(_options), do: %__MODULE__{}

  @impl Lab.Check.Kind
  def note(_asked, %{stops: nil}, _judge), do: :unseen

  def note(_asked, %{at_ms: at_ms, stops: stops} = moment, judge) do
    bodies = for {id, _claim} <- moment.claims, is_map_key(stops, id), do: moment.world.robots[id]
    held = for {id, %{held: [_ | _]}} <- stops, do: id
    lifted = lifted(moment)

    before =
      for {id, {wanted, pose}} <- judge.before, into: %{} do
        {id, {wanted, if(id in lifted, do: nil, else: pose)}}
      end

    held = Map.new(held, &{&1, Map.get(judge.held, &1, at_ms)})

    wrong =
      for body <- bodies,
          {invariant, figures} <-
            fast(body, before[body.id]) ++
              abrupt(body, before[body.id]) ++
              moving(body, before[body.id], held[body.id], at_ms),
          do: Violation.new(invariant, at_ms, [body.id], figures)

    before = Map.new(bodies, &{&1.id, {&1.wanted, &1.pose}})
    {:never, wrong, %{judge | before: before, held: held}}
  end

  # Those that a person has put somewhere else in this step.
  defp lifted(%{at_ms: at_ms, run_log: %{stages: newest_first}}) do
    now = Enum.take_while(newest_first, &(round(&1.at_s * 1000) >= at_ms - 100))
    for %{stage: :displaced, robot: id} <- now, do: id
  end

  defp fast(%{profile: profile, wanted: wanted} = body, before) do
    way = way(body, before) / @tick_s

    for {what, value, limit, unit} <- [
          {"wants", wanted.linear, profile.max_linear, "m/s"},
          {"wants", wanted.turn, profile.max_turn, "rad/s"},
          {"drives", way, profile.max_linear, "m/s"}
        ],
        abs(value) > limit + @slack,
        do: {:too_fast, "#{what} #{figure(value)} of #{figure(limit)} #{unit}"}
  end

  defp abrupt(_body, nil), do: []

  defp abrupt(%{profile: profile, wanted: now}, {was, _pose}) do
    for {from, to, limit, unit} <- [
          {was.linear, now.linear, profile.max_acceleration, "m/s"},
          {was.turn, now.turn, profile.max_turn_acceleration, "rad/s"}
        ],
        jump?(from, to, limit * @tick_s + @slack),
        do: {:too_abrupt, "from #{figure(from)} to #{figure(to)} #{unit} in #{@tick_s} s"}
  end

  # After a stop, and when the direction changes, a speed grows from zero.
  defp jump?(from, to, _most) when to == 0.0 or from == to, do: false
  defp jump?(from, to, most) when from * to < 0, do: abs(to) > most
  defp jump?(from, to, most) when abs(to) > abs(from), do: abs(to) - abs(from) > most
  defp jump?(from, to, most), do: abs(from) - abs(to) > 2 * most and abs(to) > most

  defp moving(_body, _before, nil, _at_ms), do: []

  defp moving(%{wanted: wanted} = body, before, since, at_ms) do
    cond do
      not Hal.Twist.zero?(wanted) ->
        [
          {:stop_ignored,
           "held, and wants #{figure(wanted.linear)} m/s, #{figure(wanted.turn)} rad/s"}
        ]

      at_ms - since > @brake_ms and way(body, before) > @still_m ->
        [
          {:stop_ignored,
           "held for #{at_ms - since} ms, and drives #{figure(way(body, before))} m"}
        ]

      true ->
        []
    end
  end

  defp way(_body, nil), do: 0.0
  defp way(_body, {_wanted, nil}), do: 0.0
  defp way(body, {_wanted, pose}), do: Hal.Pose.distance(body.pose, pose)

  defp figure(value), do: Violation.decimals(value, 3)
end
