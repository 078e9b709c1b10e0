defmodule Robot.Safety.DryRunTest do
  use Robot.Case, async: true
  import ExUnit.CaptureLog
  alias Robot.Safety.DryRun
  @moduletag :realtime
  doctest Robot.Safety.DryRun

  @moduletag :capture_log

  defp until_line(id, text) do
    assert_receive {[:robot, :dry_run], %{robot: ^id, line: line}}
    if line =~ text, do: line, else: until_line(id, text)
  end

  defp lines(ms) do
    receive do
      {[:robot, :dry_run], %{line: line}} -> [line | lines(ms)]
    after
      ms -> []
    end
  end

  test "everything thinks, nothing moves, what would move is told once and printed" do
    listen(:dry1, [:robot, :dry_run])
    Logger.put_module_level(DryRun, :info)
    on_exit(fn -> Logger.delete_module_level(DryRun) end)

    log =
      capture_log(fn ->
        id = rolling(:dry1, dry_run: true)
        # At full speed, which is reached by steps of acceleration: the last one may round to it.
        full = "dry run: dry1 would drive at 0.10 m/s"
        assert until_line(id, ~r"0.10 m/s$") == full
        # The mission runs and the gate is as busy as ever.
        assert {:ok, %{by: :roll}, _} = Board.fetch(Board.find!(id), :doing, :infinity)

        assert {:ok, %{twist: twist, limits: limits}, _} =
                 Board.fetch(Board.find!(id), :driving, :infinity)

        assert twist == Twist.zero() and :dry_run in limits
        stands(200)
        # The same again is no news. (On a busy machine wishes come too late, and that is news.)
        lines = [full | lines(200)]
        assert lines == Enum.dedup(lines)
        # Nobody can let the wheels loose by another way.
        drive = Names.whereis(id, :drive)
        assert Hal.Device.arm(drive) == {:error, "this is a dry run: the wheels stand"}
        Hal.Device.drive(drive, Twist.new(0.3, 0.0))
        assert Hal.Device.arming(drive).state == :disarmed
        stands(100)
      end)

    assert log =~ "dry run: dry1 would drive at 0.10 m/s"
  end

  test "the camera's head stays where it is, too" do
    listen(:dry2, [:robot, :dry_run])
    id = robot(:dry2, dry_run: true, ptz: {Hal.FakePtz, test: self(), device: :ptz})
    assert_receive {:ptz, :init, _}
    Executive.obey(id, {:look, -0.5})
    until_line(id, "would look 29 deg to the right")
    refute_receive {:ptz, {:look, _, _}, _}, 200
  end

  test "what changes by less than a person sees is not told" do
    {[{:event, [:robot, :dry_run], %{line: first}}], first} =
      DryRun.tell(:dry3, {:drive, Twist.new(0.3, 0.0), []}, nil)

    assert DryRun.tell(:dry3, {:drive, Twist.new(0.301, 0.001), []}, first) == {[], first}
    assert {[_told], other} = DryRun.tell(:dry3, {:drive, Twist.new(0.32, 0.0), []}, first)
    assert other != first
  end
end
