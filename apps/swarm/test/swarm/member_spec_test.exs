defmodule Swarm.MemberSpecTest do
  @moduledoc "What a build without a recorder says of a robot whose file wants one."
  use ExUnit.Case, async: false
  alias Hal.{Pose, Profile}
  alias Swarm.MemberSpec

  @file_of %Robot.File{
    id: :spec1,
    profile: Profile.magellan(),
    start: Pose.new(0, 0),
    drive: {Hal.FakeDrive, []}
  }
  @recorded %{@file_of | record: [folder: "/tmp/runs"]}

  defp named(module) do
    before = Application.get_env(:swarm, :recorder)
    on_exit(fn -> Application.put_env(:swarm, :recorder, before) end)
    Application.put_env(:swarm, :recorder, module)
  end

  test "a robot that is recorded is refused in one line where nothing can record it" do
    named(Mine.NotInThisBuild)
    line = "record: Mine.NotInThisBuild is configured, but not part of this release"
    assert MemberSpec.config(@recorded) == {:error, line}
    assert MemberSpec.recorders(@recorded) == {:error, line}
    assert {:ok, %{trace: nil}} = MemberSpec.config(@file_of)
    assert MemberSpec.recorders(@file_of) == {:ok, []}

    named(nil)
    line = "record: no recorder is configured (config :swarm, recorder: …)"
    assert MemberSpec.config(@recorded) == {:error, line}
    assert {:ok, %{trace: nil}} = MemberSpec.config(@file_of)
  end

  test "the configured recorder gets the robot's trace and the checked options" do
    named(Swarm.StandMission)
    assert {:ok, %{trace: {Swarm.StandMission, :trace, [:spec1]}}} = MemberSpec.config(@recorded)

    assert {:ok, [{Swarm.StandMission, {:spec1, options}}]} = MemberSpec.recorders(@recorded)
    assert options[:folder] == "/tmp/runs"
    assert options[:limit_mb] == 500
  end
end
