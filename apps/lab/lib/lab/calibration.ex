defmodule Lab.Calibration do
  @moduledoc """
  Calibrates odometry in a simulated hall, in lockstep: one robot drives the courses that a real one would, by the same
  controller and reflexes, and its true pose is what a person would have measured. Pure.

  Options of `new/1`: `profile` (a Magellan), `seed` (0), `noise` (`:default`), `wheels` (errors
  of the odometry, as in `Sim.World.Body`), `speed` (m/s, 0.3), `tape_m` (standard deviation of a
  reading of the tape, 0.003) and `tape_rad` (the same for an angle, 0.009, half a degree).
  """
  alias Hal.{Pose, Profile}
  alias Robot.Percept
  alias Robot.Control.Controller
  alias Robot.Safety.Reflex
  alias Robot.Calibration.{Drive, DriveCourse, Model}
  alias Sim.{Noise, World}

  @id :mag1
  # A square of 4 m with a speed of 0.05 m/s takes seven minutes.
  @longest_ms 900_000

  @enforce_keys [:world, :profile, :options]
  defstruct @enforce_keys ++ [draws: 0]

  @type t :: %__MODULE__{}
  @type task :: {:distance, float()} | {:angle, float()} | {:square, :cw | :ccw, float()}
  @typedoc """
  The reading of odometry, and the measurement, each from the pose before the course; radians are
  unwrapped.
  """
  @type driven :: %{told: Pose.t(), measured: Pose.t(), told_turn: float(), turn: float()}

  @doc "A robot in a hall. Options as above."
  @spec new(keyword()) :: t()
  def new(options) do
    options =
      Keyword.validate!(options,
        profile: Profile.magellan(),
        seed: 0,
        noise: :default,
        wheels: [],
        speed: 0.3,
        tape_m: 0.003,
        tape_rad: 0.009
      )

    {:ok, map} = Sim.Floorplan.open("hall", 6)
    profile = options[:profile]
    robot = %{id: @id, profile: profile, pose: Pose.new(0, 0), wheels: options[:wheels]}

    world = World.new!(map: map, robots: [robot], seed: options[:seed], noise: options[:noise])

    %__MODULE__{world: world, profile: profile, options: Map.new(options)}
  end

  @doc """
  The true errors of the robot's odometry, including the draws of the noise: what calibration
  should find.
  """
  @spec truth(t()) :: Model.t()
  def truth(%__MODULE__{world: world}) do
    %{wheels: wheels, gains: {scale, turn}} = world.robots[@id]

    %Model{
      distance: wheels.distance / scale,
      base: wheels.base * turn / scale,
      ratio: wheels.ratio
    }
  end

  @doc "Puts the robot on its mark, lets it drive, and measures."
  @spec drive(t(), task()) :: {:ok, driven(), t()} | {:error, String.t(), t()}
  def drive(%__MODULE__{} = sim, task) do
    world = World.displace(sim.world, @id, mark(task))
    before = told(world)
    course = {DriveCourse, legs: Drive.legs(task), speed: sim.options.speed}
    controller = Controller.goal(Controller.new(profile: sim.profile), :course, course)

    s = %{
      world: world,
      controller: controller,
      reflex: Reflex.new(sim.profile),
      profile: sim.profile,
      turns: {0.0, 0.0},
      until_ms: world.at_ms + @longest_ms
    }

    case go(sense(s)) do
      {1, s} -> measure(%{sim | world: s.world}, task, before, s.turns)
      {_blocked, s} -> {:error, "the simulated robot came no further", %{sim | world: s.world}}
    end
  end

  # With room for a square on either side.
  defp mark({:square, :cw, side}), do: Pose.new(-side / 2, side / 2)
  defp mark({:square, :ccw, side}), do: Pose.new(-side / 2, -side / 2)
  defp mark({:distance, way}), do: Pose.new(-way / 2, 0)
  defp mark({:angle, _turn}), do: Pose.new(0, 0)

  defp told(world), do: world.robots[@id].odometry

  # As in `Lab.Trial`: controller and reflex, act, reflex again 50 ms later.
  defp go(%{world: %{at_ms: at_ms}, until_ms: until_ms} = s) when at_ms > until_ms, do: {2, s}

  defp go(s) do
    at_ms = s.world.at_ms
    {wish, outcome, controller} = Controller.tick(s.controller, percept(s))
    s = %{s | controller: controller, reflex: Reflex.wish(s.reflex, wish.twist, at_ms)}
    s = s |> act() |> act()

    case outcome do
      nil -> go(s)
      {:course, outcome} -> {outcome, s}
    end
  end

  defp percept(%{world: world, profile: profile}) do
    percept = %Percept{robot: @id, at_ms: world.at_ms, profile: profile}

    for {key, value} <- World.readings(world, @id),
        key in [:odometry, :sonar, :bumpers],
        into: %{} do
      {key, value}
    end
    |> then(&struct!(percept, &1))
  end

  defp act(s) do
    {twist, _limits, reflex} = Reflex.step(s.reflex, s.world.at_ms)
    before = {told(s.world).heading, World.truth(s.world, @id).heading}
    world = s.world |> World.drive(@id, twist) |> World.step(50)
    now = {told(world).heading, World.truth(world, @id).heading}
    sense(%{s | world: world, reflex: reflex, turns: further(s.turns, before, now)})
  end

  defp further({a, b}, {a0, b0}, {a1, b1}), do: {a + Pose.wrap(a1 - a0), b + Pose.wrap(b1 - b0)}

  defp sense(s) do
    reflex =
      s.world
      |> World.readings(@id)
      |> Enum.reduce(s.reflex, &elem(Reflex.sense(&2, &1, s.world.at_ms), 0))

    %{s | reflex: reflex}
  end

  defp measure(sim, task, before, {told_turn, turn}) do
    {dx, sim} = draw(sim)
    {dy, sim} = draw(sim)
    {da, sim} = draw(sim)
    %{tape_m: m, tape_rad: rad} = sim.options
    end_pose = Pose.relative(mark(task), World.truth(sim.world, @id))

    driven = %{
      told: Pose.relative(before, told(sim.world)),
      measured: Pose.new(end_pose.x + m * dx, end_pose.y + m * dy, end_pose.heading + rad * da),
      told_turn: told_turn,
      turn: turn + rad * da
    }

    {:ok, driven, sim}
  end

  defp draw(sim) do
    draw = Noise.gauss(Noise.hash(sim.options.seed, 0x7A9E, sim.draws, 0))
    {draw, %{sim | draws: sim.draws + 1}}
  end
end
