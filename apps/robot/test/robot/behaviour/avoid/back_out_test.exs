defmodule Robot.Behaviour.Avoid.BackOutTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Body, Percept}
  alias Robot.Behaviour.Avoid.BackOut
  alias Robot.Behaviour.Blocker

  @mini Profile.atrv_mini()
  # Posts beside both of its front corners, as near as its sonars measure.
  @posts @mini |> Body.silence() |> List.replace_at(1, 0.15) |> List.replace_at(9, 0.15)
  @clear Body.silence(@mini)

  defp percept(pose, at_ms, options \\ []) do
    %Percept{
      robot: :min1,
      at_ms: at_ms,
      profile: options[:profile] || @mini,
      pose: pose,
      odometry: %Odometry{pose: pose, twist: Twist.zero()},
      sonar: options[:sonar] || @posts,
      driving: %{twist: options[:twist] || Twist.zero(), limits: options[:limits] || [:corner]}
    }
  end

  # It came along these places; then it stands in the last pose, and its turns are refused for so long.
  defp stand(path, pose, for_ms, options \\ []) do
    came = Enum.reduce(path, %BackOut{}, &elem(BackOut.note(&2, percept(&1, 0, limits: [])), 1))

    Enum.reduce(0..for_ms//100, {nil, came}, fn at_ms, {_speed, state} ->
      BackOut.note(state, percept(pose, at_ms, options))
    end)
  end

  defp line(from, to), do: for(k <- 0..20, do: Pose.new(from + (to - from) * k / 20, 0.0))

  test "after two seconds in which its turns are refused, it drives out the way that it came" do
    assert {nil, _state} = stand(line(-0.8, 0), Pose.new(0, 0), 1_900)
    assert {-0.1, state} = stand(line(-0.8, 0), Pose.new(0, 0), 2_000)

    # As far as it came straight, at most 0.6 m, while its sonars still see the posts.
    assert {-0.1, state} = BackOut.note(state, percept(Pose.new(-0.55, 0), 2_100))
    assert {nil, %{out: nil}} = BackOut.note(state, percept(Pose.new(-0.61, 0), 2_200))

    # Or until it can turn.
    assert {-0.1, state} = BackOut.note(state, percept(Pose.new(-0.05, 0), 2_300, sonar: @clear))

    assert {nil, %{out: nil}} =
             BackOut.note(state, percept(Pose.new(-0.12, 0), 2_400, sonar: @clear))
  end

  test "one that came backwards drives out ahead, where its sonars see room" do
    ahead = Enum.reverse(line(0, 0.8))
    behind = @clear |> List.replace_at(6, 0.15) |> List.replace_at(14, 0.15)
    assert {0.1, _state} = stand(ahead, Pose.new(0, 0), 2_000, sonar: behind)

    # Never against what the gate would not let it drive at.
    assert {-0.1, _state} = stand(ahead, Pose.new(0, 0), 2_000, sonar: @posts)
    shut = List.replace_at(@posts, 7, 0.15)
    assert {nil, %{out: nil}} = stand(ahead, Pose.new(0, 0), 4_000, sonar: shut)
  end

  test "one whose wheels move, that may turn, or that is round, does nothing" do
    way = line(-0.8, 0)
    assert {nil, _} = stand(way, Pose.new(0, 0), 9_000, limits: [:near])
    assert {nil, _} = stand(way, Pose.new(0, 0), 9_000, twist: Twist.new(0, 0.2))
    round = Profile.magellan()
    options = [profile: round, sonar: Body.silence(round)]
    assert {nil, _} = stand(way, Pose.new(0, 0), 9_000, options)
  end

  test "what keeps it from its place is that it cannot turn, and no robot that stands about" do
    blocker = &Blocker.find(percept(Pose.new(0, 0), 0, &1), {3.0, 0.0})
    assert blocker.([]) == :no_turn
    assert Blocker.words(:no_turn) == "no room to turn"
    assert blocker.(limits: [], sonar: @clear) == :no_way
  end
end
