defmodule Missions.Push.Plan do
  @moduledoc """
  Computes from which side two robots push a box, where they stand, and how fast each drives. Pure; metres in the map frame, radians.

  They push the longer side whose normal points nearest to the goal, 0.4 m to the left and to the right of its middle, as the two
  wheels of a robot that can only go forwards: the box turns towards the one that is slower. With the angle `e` from the normal to the
  goal they drive with `v cos e`, 0.4 m times `e` per second faster on the outer side and slower on the inner one, and never backwards.
  """
  alias Hal.Pose
  alias Missions.Push.Box
  alias Nav.Reach

  # From the middle of the side; between the bodies before they touch the box; while they touch it.
  @aside 0.4
  @before 0.35
  @touch 0.03
  # Between a robot of a pair and a wreck; more of it ends that one pushes alone; between that one and a wreck.
  @beside 0.15
  @more 0.1
  @tight 0.15
  # Where a lone one pushes, and how far aside for each radian that the goal is beside.
  @asides [0.0, 0.06, -0.06, 0.12, -0.12, 0.18, -0.18, 0.25, -0.25, 0.32, -0.32, 0.4, -0.4]
  @steer 0.4
  @most_aside 0.25
  # The other side is taken when the goal is farther from the normal than this.
  @other 1.9
  @turn 1.0
  @most_turn 0.4
  @closing 0.1
  # One waits for the other when it is nearer to the box by this.
  @ahead 0.08
  @sideways 0.06
  # A robot that pushes goes on while it is at most so far from its place, and not turned further than this.
  @off 0.3
  @turned 1.0

  @typedoc """
  The box as it is believed to lie, and what is to be done with it. Robots push its long side in the `direction`, two of them, or a lone one `aside` of
  the middle; `taken` is where wrecks stand.
  """
  @type scene :: %{
          required(:box) => Pose.t(),
          required(:size) => Box.size(),
          required(:goal) => Pose.point(),
          required(:way) => :pair | :lone,
          required(:aside) => float(),
          required(:direction) => float(),
          required(:speed) => float(),
          required(:radius) => float(),
          required(:broadest) => float(),
          required(:grid) => Nav.Grid.t() | nil,
          required(:taken) => [{float(), float(), float()}],
          optional(atom()) => term()
        }

  @typedoc "On the left, on the right, or alone."
  @type side :: 1 | -1 | 0

  @doc "The places at the box in a scene."
  @spec sides(scene()) :: [side(), ...]
  def sides(%{way: :pair}), do: [1, -1]
  def sides(%{way: :lone}), do: [0]

  @doc """
  The scene with way and direction; `nil` if nowhere is room. `before` and `direction` are those in which robots push already, `nil` for none.
  Where a wreck stands at one of the two places, or a wall, one robot pushes alone, until both have room.
  """
  @spec choose(map(), :pair | :lone | nil, float() | nil) :: scene() | nil
  def choose(%{box: box, goal: goal} = scene, before, direction) do
    direction = direction(box, goal, direction)
    straight = Map.merge(scene, %{way: :pair, aside: 0.0, direction: direction})

    if free?(straight, @beside + if(before == :lone, do: @more, else: 0.0)),
      do: straight,
      else: lone(%{straight | way: :lone})
  end

  # A box that is pushed on the right of its middle turns to the left.
  defp lone(scene) do
    wanted = (-@steer * beside(scene)) |> max(-@most_aside) |> min(@most_aside)

    @asides
    |> Enum.sort_by(&abs(&1 - wanted))
    |> Enum.map(&%{scene | aside: &1})
    |> Enum.find(&free?(&1, @tight))
  end

  defp free?(%{broadest: radius} = scene, clear) do
    Enum.all?(sides(scene), fn side ->
      # There, and where it touches the box.
      Enum.all?([@before, 0.0], fn behind ->
        place = at(scene, side, radius + behind)

        Enum.all?(scene.taken, fn {x, y, r} ->
          Pose.distance({x, y}, place) > r + radius + clear
        end) and
          (behind == 0.0 or Reach.place(scene.grid, place, radius) == :ok)
      end)
    end)
  end

  @doc """
  The direction in which a pair pushes a box to a goal; one in which it is pushed already is kept as long as that is possible.

      iex> box = Hal.Pose.new(0, 0, 0)
      iex> Float.round(Missions.Push.Plan.direction(box, {1.0, 3.0}, nil), 3)
      1.571
      iex> Float.round(Missions.Push.Plan.direction(box, {1.0, -0.1}, 1.5), 3)
      1.571
  """
  @spec direction(Pose.t(), Pose.point(), float() | nil) :: float()
  def direction(%Pose{} = box, {x, y}, before) do
    towards = :math.atan2(y - box.y, x - box.x)
    normals = for side <- [1, -1], do: Pose.wrap(box.heading + side * :math.pi() / 2)
    nearest = fn angle -> Enum.min_by(normals, &abs(Pose.wrap(&1 - angle))) end
    kept = before && nearest.(before)
    if kept && abs(Pose.wrap(towards - kept)) < @other, do: kept, else: nearest.(towards)
  end

  @doc "Where a robot stands before it touches the box."
  @spec place(scene(), side()) :: Pose.point()
  def place(scene, side), do: at(scene, side, scene.radius + @before)

  defp at(%{box: box, direction: direction, size: {_length, width}} = scene, side, far),
    do: Pose.place(Pose.new(box.x, box.y, direction), {-(width / 2 + far), aside(scene, side)})

  defp aside(%{aside: aside}, 0), do: aside
  defp aside(_scene, side), do: side * @aside

  @doc "Whether a robot that pushes on a side is where it can."
  @spec pushes?(scene(), side(), Pose.t()) :: boolean()
  def pushes?(scene, side, pose) do
    {behind, aside} = offset(scene, side, pose, scene.radius)

    abs(aside) < @off and behind < @before + @off and
      abs(Pose.wrap(pose.heading - scene.direction)) < @turned
  end

  @doc "How far a robot is from the box, edge to edge, and how far too far to the left of its place."
  @spec offset(scene(), side(), Pose.t(), float()) :: {behind :: float(), aside :: float()}
  def offset(%{box: box, direction: direction} = scene, side, %Pose{} = pose, radius) do
    {_length, width} = scene.size
    at = Pose.relative(Pose.new(box.x, box.y, direction), pose)
    {-at.x - width / 2 - radius, at.y - aside(scene, side)}
  end

  @doc "The velocity with which a robot at a pose pushes on its side; `partner` is how far the other one of a pair is from the box."
  @spec velocity(scene(), side(), Pose.t(), partner :: float()) :: {float(), float()}
  def velocity(%{direction: direction} = scene, side, pose, partner) do
    {behind, aside} = offset(scene, side, pose, scene.radius)
    ahead? = partner > @touch and behind < partner - @ahead

    forwards =
      cond do
        ahead? -> 0.0
        behind > @touch -> @closing
        partner > 2 * @touch -> 0.0
        true -> wheel(scene, side)
      end

    sideways = (-0.8 * aside) |> max(-@sideways) |> min(@sideways)
    sideways = if forwards < 0.03, do: 0.0, else: sideways
    {c, s} = {:math.cos(direction), :math.sin(direction)}
    {forwards * c - sideways * s, forwards * s + sideways * c}
  end

  defp wheel(%{way: :lone, speed: speed}, _side), do: speed

  defp wheel(%{box: box, goal: {x, y}, speed: speed} = scene, side) do
    beside = beside(scene)
    turn = (@turn * beside) |> max(-@most_turn) |> min(@most_turn)
    # Near the goal the direction to it says little.
    turn = turn * min(Pose.distance(box, {x, y}) / 0.5, 1.0)

    (speed * max(:math.cos(beside), 0.0) - side * turn * @aside)
    |> max(0.0)
    |> min(1.5 * speed)
  end

  defp beside(%{box: box, goal: {x, y}, direction: direction}),
    do: Pose.wrap(:math.atan2(y - box.y, x - box.x) - direction)
end
