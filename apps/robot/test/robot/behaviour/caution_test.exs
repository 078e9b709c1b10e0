defmodule Robot.Behaviour.CautionTest do
  @moduledoc "A robot among others that does not know where it is."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.{Acts, Behaviour, Percept}
  alias Robot.Behaviour.{Avoid, Goto}

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
    assert {:running, wish, _state} = Behaviour.tick(Avoid.new(inner: inner), percept)
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
end
