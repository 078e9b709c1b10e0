defmodule Robot.Behaviour.CautionTest do
  @moduledoc "A robot among others that does not know where it is."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.{Acts, Percept}
  alias Robot.Behaviour.{Avoid, Goto}

  doctest Robot.Behaviour.Avoid.Echoes

  defp percept(lost?, peers) do
    %Percept{
      robot: :mag1,
      at_ms: 0,
      profile: Profile.magellan(),
      pose: Pose.new(0, 0),
      peers: peers,
      uncertainty: %{radius: 4.0, lost?: lost?}
    }
  end

  defp speed(inner, percept) do
    assert {:running, wish, _state} = Robot.Behaviour.tick(Avoid.new(inner: inner), percept)
    wish.twist.linear
  end

  test "it drives no faster than its sonars alone are good for, whatever is wished" do
    far = %{
      mag2: %{pose: Pose.new(0, 9), twist: Twist.zero(), radius: 0.2, at_ms: 0, mode: :holding}
    }

    roll = fn linear -> Acts.Roll.new(twist: Twist.new(linear, 0.0)) end

    for inner <- [roll.(0.5), Goto.new(x: 5.0, y: 0.0)] do
      assert speed(inner, percept(false, far)) > 0.3
      assert speed(inner, percept(true, far)) == 0.2
      # Alone there is nobody to run into.
      assert speed(inner, percept(true, %{})) > 0.3
    end

    assert speed(roll.(-0.5), percept(true, far)) == -0.1
    assert speed(roll.(0.1), percept(true, far)) == 0.1
  end

  test "among others it slows down for what it cannot explain, if one is silent or its own place is not sure" do
    index = Enum.find_index(Profile.magellan().sonars, &(abs(&1.heading - 1.5708) < 0.01))
    echo = List.replace_at(List.duplicate(5.1, 16), index, 0.8)
    there = Pose.new(0.0, 1.2)

    peers = fn mode, pose ->
      %{mag2: %{pose: pose, twist: Twist.zero(), radius: 0.2, at_ms: -5_000, mode: mode}}
    end

    # Whence it may have come meanwhile, and where it may be though it tells another place; and too far for both.
    far = Pose.new(0.0, 3.5)
    too_far = Pose.new(0.0, 9.0)
    inner = Goto.new(x: 5.0, y: 0.0)
    sees = fn percept, sonar -> %{percept | sonar: sonar} end
    sure = put_in(percept(false, %{}).uncertainty.radius, 0.3)

    slow = [
      sees.(%{sure | peers: peers.(:dead, far)}, echo),
      sees.(percept(false, peers.(:moving, far)), echo)
    ]

    fast = [
      sees.(%{sure | peers: peers.(:moving, far)}, echo),
      sees.(%{sure | peers: peers.(:dead, too_far)}, echo),
      sees.(percept(false, peers.(:moving, too_far)), echo),
      # What it sees is the silent robot, where it was last heard.
      sees.(%{sure | peers: peers.(:dead, there)}, echo),
      sees.(%{sure | peers: peers.(:dead, far)}, List.duplicate(5.1, 16)),
      sees.(percept(false, %{}), echo)
    ]

    for percept <- slow, do: assert(speed(inner, percept) == 0.2)
    for percept <- fast, do: assert(speed(inner, percept) > 0.3)
  end

  test "where walls are that nobody has told of, what has stayed where it is slows it down no longer" do
    index = Enum.find_index(Profile.magellan().sonars, &(abs(&1.heading - 1.5708) < 0.01))
    echo = fn range -> List.replace_at(List.duplicate(5.1, 16), index, range) end
    peer = %{pose: Pose.new(0, 3), twist: Twist.zero(), radius: 0.2, at_ms: 0, mode: :moving}
    percept = percept(false, %{mag2: peer})

    # The speeds at the end of so many ticks of 100 ms with these ranges.
    last = fn ranges, options ->
      avoid = Avoid.new([inner: Goto.new(x: 90.0, y: 0.0)] ++ options)

      {speeds, _state} =
        ranges
        |> Enum.with_index()
        |> Enum.map_reduce(avoid, fn {range, n}, state ->
          percept = %{percept | sonar: echo.(range), at_ms: 100 * n}
          {:running, wish, state} = Robot.Behaviour.tick(state, percept)
          {wish.twist.linear, state}
        end)

      List.last(speeds)
    end

    wall = List.duplicate(1.0, 17)
    assert last.(wall, unmapped: true) > 0.3
    assert last.(wall, []) == 0.2
    assert last.(Enum.take(wall, 14), unmapped: true) == 0.2

    # What comes nearer by 0.3 m/s does not stay where it is; nor does what was not there in between.
    assert last.(for(n <- 0..16, do: 1.3 - 0.03 * n), unmapped: true) == 0.2
    assert last.(Enum.map(0..16, &if(&1 in 6..11, do: 3.0, else: 1.0)), unmapped: true) == 0.2
  end

  defmodule Aside do
    @behaviour Robot.Behaviour
    @impl Robot.Behaviour
    def new(options), do: {__MODULE__, options[:velocity]}
    @impl Robot.Behaviour
    def update(_options, velocity), do: {__MODULE__, velocity}
    @impl Robot.Behaviour
    def tick(_percept, velocity) do
      wish = %Robot.Wish{
        by: :aside,
        weight: 1.0,
        twist: Twist.new(0.0, 0.0),
        velocity: velocity,
        goal: {2.0, 0.0}
      }

      {:running, %{wish | reverse?: true}, {__MODULE__, velocity}}
    end
  end

  # The least of a second, in which one comes towards it.
  defp backwards(percept) do
    coming = %{
      pose: Pose.new(0.7, 0.05, 3.14),
      twist: Twist.new(0.3, 0.0),
      radius: 0.2,
      at_ms: 0,
      mode: :moving
    }

    percept = %{percept | peers: %{mag2: coming}}

    {speeds, _state} =
      Enum.map_reduce(1..10, Avoid.new(inner: Aside.new(velocity: {-0.15, 0.1})), fn n, state ->
        {:running, wish, state} = Robot.Behaviour.tick(state, %{percept | at_ms: 100 * n})
        {wish.twist.linear, state}
      end)

    Enum.min(speeds)
  end

  test "nor is the way out of another's way faster backwards; a slow body is no exception" do
    lost = percept(true, %{})
    slow = %{lost | profile: %{lost.profile | max_linear: 0.2}}
    for percept <- [lost, slow], do: assert(backwards(percept) == -0.1)
    assert backwards(percept(false, %{})) < -0.15
  end
end
