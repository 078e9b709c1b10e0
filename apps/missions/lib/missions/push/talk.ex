defmodule Missions.Push.Talk do
  @moduledoc """
  Writes and reads what the robots of `Missions.Push` tell each other: what each sees of the box, or is sure of, which place it has there, and
  how far it is from each. Pure. On the air lengths are whole millimetres and angles milliradians.
  """
  alias Hal.Pose
  alias Missions.Push.Estimate

  @most_mm 20_000_000
  @most_mrad 3_200
  # What was seen so recently may be told to those that know nothing.
  @tell_box_ms 2_000

  @typedoc "What another robot told last; its `costs` are the ways to the places, in metres."
  @type peer :: %{
          at_ms: integer(),
          side: Missions.Push.Plan.side() | nil,
          stage: Missions.Push.Places.stage(),
          direction: float() | nil,
          costs: %{Missions.Push.Plan.side() => float()}
        }

  @doc "The table of the messages."
  @spec table() :: {pos_integer(), keyword()}
  def table do
    mm = {:integer, -@most_mm, @most_mm, "mm"}
    angle = {:integer, -@most_mrad, @most_mrad, "mrad"}
    sd = {:integer, 0, 10_000, "mm"}
    cost = {:or, nil, {:integer, 0, @most_mm, "mm"}}

    {2,
     box: [
       plan: [{:integer, 0, 0xFFFFFFF}, required: true],
       side: [{:or, nil, {:integer, -1, 1}}, required: true],
       stage: [{:one_of, [:none, :approach, :ready, :push]}, required: true],
       direction: [{:or, nil, angle}, required: true],
       left_mm: [cost, required: true],
       right_mm: [cost, required: true],
       lone_mm: [cost, required: true],
       box: [
         {:or, nil, {:tuple, [mm, mm, angle, sd], "{x, y, heading, sd} in mm and mrad"}},
         required: true
       ],
       at: [{:or, nil, {:tuple, [mm, mm], "{x, y} in mm"}}, required: true],
       axis: [angle, required: true],
       edges: [
         {:tuple, [{:or, nil, angle}, {:or, nil, angle}], "{left, right} in mrad"},
         required: true
       ],
       near_mm: [{:or, nil, {:integer, 0, 100_000, "mm"}}, required: true],
       sd_mm: [sd, required: true],
       sd_mrad: [{:integer, 0, 10_000, "mrad"}, required: true]
     ]}
  end

  @doc "What a robot tells; `costs` are its ways to the places."
  @spec body(Missions.Push.t(), %{Missions.Push.Plan.side() => float()}) :: keyword()
  def body(mission, costs) do
    [
      plan: mission.plan,
      side: mission.side,
      stage: mission.stage,
      direction: mission.side && mrad(mission.direction),
      box: told_box(mission),
      left_mm: mm(costs[1]),
      right_mm: mm(costs[-1]),
      lone_mm: mm(costs[0])
    ] ++ told(mission.sighting)
  end

  defp told_box(%{box: box, now_ms: now_ms}) do
    with true <- Estimate.sure?(box) and now_ms - box.seen_ms < @tell_box_ms,
         {%{x: x, y: y, heading: heading}, _sd, _sd_heading} = Estimate.best(box),
         true <- abs(x) < 1.0e4 and abs(y) < 1.0e4 do
      {round(1000 * x), round(1000 * y), mrad(heading), min(round(1000 * box.sd), 10_000)}
    else
      false -> nil
    end
  end

  defp told(%{at: {x, y}} = seen) when abs(x) < 1.0e4 and abs(y) < 1.0e4 do
    [
      at: {round(1000 * x), round(1000 * y)},
      axis: mrad(seen.axis),
      edges: {mrad(seen.left), mrad(seen.right)},
      near_mm: seen.near && min(round(1000 * seen.near), 100_000),
      sd_mm: min(round(1000 * seen.sd), 10_000),
      sd_mrad: min(round(1000 * seen.sd_heading), 10_000)
    ]
  end

  defp told(_none), do: [at: nil, axis: 0, edges: {nil, nil}, near_mm: nil, sd_mm: 0, sd_mrad: 0]

  defp mm(nil), do: nil
  defp mm(metres), do: min(round(1000 * metres), @most_mm)
  defp mrad(nil), do: nil
  defp mrad(angle), do: round(1000 * angle)

  @doc "What another robot told, at this time."
  @spec peer(map(), integer()) :: peer()
  def peer(said, now_ms) do
    costs = [{1, said.left_mm}, {-1, said.right_mm}, {0, said.lone_mm}]

    %{
      at_ms: now_ms,
      side: said.side,
      stage: said.stage,
      direction: said.direction && said.direction / 1000,
      costs: for({side, mm} when mm != nil <- costs, into: %{}, do: {side, mm / 1000})
    }
  end

  @doc "What it saw of the box; `nil` for nothing."
  @spec sighting(map()) :: Estimate.sighting() | nil
  def sighting(%{at: nil}), do: nil

  def sighting(%{at: {x, y}, edges: {left, right}} = said) do
    %{
      at: {x / 1000, y / 1000},
      axis: said.axis / 1000,
      left: left && left / 1000,
      right: right && right / 1000,
      near: said.near_mm && said.near_mm / 1000,
      sd: said.sd_mm / 1000,
      sd_heading: said.sd_mrad / 1000
    }
  end

  @doc "Where it is sure that the box lies, and how uncertain it is of its own place (m); `nil` if it is not sure."
  @spec box(map()) :: {Pose.t(), sd :: float()} | nil
  def box(%{box: nil}), do: nil

  def box(%{box: {x, y, heading, sd}}),
    do: {Pose.new(x / 1000, y / 1000, heading / 1000), sd / 1000}
end
