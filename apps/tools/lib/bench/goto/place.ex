defmodule Bench.Goto.Place do
  @moduledoc """
  Measures how well one robot that has the floor plan knows where it is: `mix bench goto --place HOW`. A draw is one run in
  lockstep: it drives from a random free pose to random places for 50 m, or wanders and is lifted to another place after 20 s, which
  its wheels do not count.
  """
  alias Bench.Goto
  alias Hal.Pose
  alias Robot.Control.Controller
  alias Nav.Reach
  alias Robot.Percept
  alias Lab.Trial
  alias Sim.{Floorplan, World}
  alias Swarm.Member

  @way_m 50.0
  @lift_ms 20_000
  # So long after it was lifted (ms) it is looked at.
  @after_ms 100_000
  # A robot that drives has so much time (ms).
  @most_ms 400_000
  # It is wrong when it is farther off than this (metres) and than it says.
  @wrong_m 0.5
  # How far it is lifted at least and at most (metres).
  @near {1.0, 3.0}
  @beside 0.05
  @tries 100_000

  @typedoc """
  `offs` is how far (metres) the robot truly was from where it told to be, at each tick before it was lifted, `inside` the share of
  ticks in which that was within what it told of its uncertainty. Seconds since it was lifted: `lost_s`, when it said so, and
  `found_s`, when it no longer did, `nil` for never; `wrong_s` is the longest time without a break in which it was wrong, and did not
  say that it is lost, later than 5 s.
  """
  @type measured :: %{
          map: String.t(),
          seed: integer(),
          offs: [float()],
          inside: float(),
          lost_s: float() | nil,
          found_s: float() | nil,
          found_off: float() | nil,
          wrong_s: float()
        }

  @doc "One draw: `:way` drives, `:near` is lifted by 1 to 3 m, `:anywhere` is lifted to anywhere."
  @spec run(String.t(), integer(), :way | :near | :anywhere, Sim.World.Body.noise()) ::
          {:ok, measured()} | {:error, String.t()}
  def run(map, seed, how, noise) do
    kind = Enum.at([:mag1, :min1], rem(seed, 2))
    options = %{robots: [kind], map: map, seed: seed, landmark: :none, plan: :known}
    options = Map.merge(options, %{noise: noise, blobs: :direct, duration_s: 10_000})

    with {:ok, setup} <- Trial.setup(options),
         {:ok, {from, _goal, _way_m}} <- Goto.draw(setup, kind, seed) do
      trial = setup |> Goto.placed(from) |> Trial.begin()
      draws = :rand.seed_s(:exsss, {seed, :erlang.phash2(map), 2})
      {:ok, measure(samples(how, trial, setup, kind, draws), map, seed)}
    end
  end

  # The ticks of a run, in order: {time in ms, off, radius, whether it says that it is lost}, and when it was lifted.
  defp samples(:way, trial, setup, kind, draws) do
    trial = Trial.command(trial, kind, goal(setup, kind, draws))
    {drive(trial, {setup, kind, draws, 0.0, World.truth(trial.world, kind)}, []), nil}
  end

  defp samples(how, trial, setup, kind, draws) do
    trial = Trial.command(trial, kind, :wander)
    {trial, before} = look(trial, kind, @lift_ms, [])
    {x, y, turn} = place(how, setup, kind, World.truth(trial.world, kind), draws)
    trial = Trial.displace(trial, kind, {x, y, 360.0 * turn})
    {_trial, samples} = look(trial, kind, @lift_ms + @after_ms, before)
    {Enum.reverse(samples), @lift_ms}
  end

  defp look(%{at_ms: at_ms} = trial, _kind, until_ms, samples) when at_ms >= until_ms,
    do: {trial, samples}

  defp look(trial, kind, until_ms, samples) do
    trial = Trial.step(trial)
    look(trial, kind, until_ms, [sample(trial, kind) | samples])
  end

  defp drive(trial, {setup, kind, draws, way, last}, samples) do
    trial = Trial.step(trial)
    truth = World.truth(trial.world, kind)
    way = way + Pose.distance(last, truth)
    samples = [sample(trial, kind) | samples]

    cond do
      way >= @way_m or trial.at_ms >= @most_ms ->
        Enum.reverse(samples)

      Member.runner(Trial.robot(trial, kind)).phase in [:done, :given_up] ->
        {_number, draws} = :rand.uniform_s(draws)
        trial = Trial.command(trial, kind, goal(setup, kind, draws))
        drive(trial, {setup, kind, draws, way, truth}, samples)

      true ->
        drive(trial, {setup, kind, draws, way, truth}, samples)
    end
  end

  defp goal(setup, kind, draws) do
    {number, _draws} = :rand.uniform_s(1_000_000, draws)
    {:ok, {_from, {x, y}, _way_m}} = Goto.draw(setup, kind, number)
    {:goto, x, y, nil}
  end

  defp place(how, %{map: map, plan: plan} = setup, kind, truth, draws, left \\ @tries)
       when left > 0 do
    {[a, b, turn], draws} =
      Enum.map_reduce(1..3, draws, fn _, draws -> :rand.uniform_s(draws) end)

    radius = setup.options.bodies[kind].radius
    {x, y} = at = candidate(how, map, truth, {a, b})

    if Floorplan.free?(map, at, radius + @beside) and
         Reach.check(plan, Pose.point(truth), at, radius) == :ok,
       do: {x, y, turn},
       else: place(how, setup, kind, truth, draws, left - 1)
  end

  defp candidate(:anywhere, map, _truth, {a, b}) do
    {width, height} = Floorplan.size(map)
    {(a - 0.5) * width, (b - 0.5) * height}
  end

  defp candidate(:near, _map, truth, {a, b}) do
    {least, most} = @near
    {way, angle} = {least + a * (most - least), 2 * :math.pi() * b}
    {truth.x + way * :math.cos(angle), truth.y + way * :math.sin(angle)}
  end

  defp sample(trial, kind) do
    %Percept{pose: pose, uncertainty: uncertainty} =
      percept = Controller.percept(Member.role(Trial.robot(trial, kind), :executive).controller)

    off = Pose.distance(pose, Pose.point(World.truth(trial.world, kind)))
    {trial.at_ms, off, uncertainty.radius, Percept.astray(percept) != nil}
  end

  defp measure({samples, lift_ms}, map, seed) do
    {before, later} =
      Enum.split_while(samples, fn {at_ms, _, _, _} -> lift_ms == nil or at_ms <= lift_ms end)

    since = fn {at_ms, _, _, _} -> (at_ms - lift_ms) / 1_000 end
    lost = Enum.find(later, fn {_at_ms, _off, _radius, lost?} -> lost? end)
    found = lost && Enum.find(later, &(since.(&1) > since.(lost) and not elem(&1, 3)))

    %{
      map: map,
      seed: seed,
      offs: Enum.map(before, &elem(&1, 1)),
      inside: Enum.count(before, fn {_, off, radius, _} -> off <= radius end) / length(before),
      lost_s: lost && since.(lost),
      found_s: found && since.(found),
      found_off: found && elem(found, 1),
      wrong_s: later |> Enum.drop_while(&(since.(&1) <= 5.0)) |> wrong_s()
    }
  end

  defp wrong_s(samples) do
    samples
    |> Enum.chunk_by(fn {_at_ms, off, radius, lost?} ->
      off > @wrong_m and off > radius and not lost?
    end)
    |> Enum.filter(fn [{_at_ms, off, radius, lost?} | _] ->
      off > @wrong_m and off > radius and not lost?
    end)
    |> Enum.map(&(length(&1) / 10))
    |> Enum.max(fn -> 0.0 end)
  end
end
