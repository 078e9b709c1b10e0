defmodule Record.GiverTest do
  @moduledoc "Who commanded a robot: its log and its recording say it."
  use Swarm.Case, async: false
  alias Record.{Recorder, Recording, Replay}
  alias Record.Replay.LastOrder
  alias Robot.Devices.Log
  doctest Record.Replay.LastOrder
  @moduletag :tmp_dir

  # What the replay holds for the last order after each entry, once for each.
  defp orders(path, id) do
    {:ok, file} = Recording.File.open(path)

    file
    |> Recording.File.entries()
    |> Enum.scan({Replay.new(), nil}, fn entry, {replay, _difference} ->
      Replay.step(replay, entry)
    end)
    |> Enum.map(fn {replay, difference} ->
      assert difference == nil

      with %{order: %{order: order, by: by, obeyed?: true}} <- Replay.moment(replay, id),
           do: {order, by}
    end)
    |> Enum.filter(&is_tuple/1)
    |> Enum.dedup()
  end

  test "a robot that two give orders to says who gave which", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    options = [robots: [:given1], file: [path: path]]
    recorder = start_supervised!(%{id: :recorder, start: {Recorder, :start_link, [options]}})
    id = robot(:given1, trace: {Recorder, :trace, [:given1]})
    listen(id, [:swarm, :comms, :ordered])

    page = "page 127.0.0.1:5123"
    assert Swarm.by(page, fn -> Swarm.goto(id, {1.0, 1.0}) end) == :ok
    assert Swarm.by("gamepad", fn -> Swarm.stop(id) end) == :ok
    # Junk and what is too long are left out, and it is this node that commands.
    for junk <- ["two\nlines", String.duplicate("a", 61), "\e[2J", <<255>>, :page, nil],
        do: assert(Swarm.by(junk, fn -> Swarm.goto(id, {2.0, 1.0}) end) == :ok)

    assert Swarm.by("gamepad", fn -> Swarm.tell(id, {:move, 0.1, 0.0, 0.3}) end) == :ok
    assert Swarm.by("gamepad", fn -> Swarm.tell(id, {:move, 0.2, 0.0, 0.3}) end) == :ok
    # A robot that is held refuses, and tells nothing.
    assert Swarm.by(page, &Swarm.estop/0) == :ok
    assert {:error, _held} = Swarm.by("gamepad", fn -> Swarm.goto(id, {3.0, 1.0}) end)
    assert Swarm.by(page, &Swarm.reset/0) == :ok

    for line <-
          ["goto 1.0 1.0, by page 127.0.0.1:5123", "stop, by gamepad"] ++
            List.duplicate("goto 2.0 1.0, by nonode@nohost", 6) ++
            ["move 0.1 0.0 0.3, by gamepad"] ++
            ["estop, by page 127.0.0.1:5123", "reset, by page 127.0.0.1:5123"] do
      assert_receive {[:swarm, :comms, :ordered], about}
      assert Log.line(:ordered, about) == {:info, "given1: #{line}"}
    end

    # All that came to comms before it has been told.
    assert {:ok, _line} = Swarm.ask(id, :ping)
    refute_received {[:swarm, :comms, :ordered], _about}

    stop_supervised!(id)
    assert Recorder.close(recorder) == :ok

    assert [
             {{:goto, 1.0, 1.0, nil}, "page 127.0.0.1:5123"},
             {:stop, "gamepad"},
             {{:goto, 2.0, 1.0, nil}, "nonode@nohost"},
             {{:move, 0.1, +0.0, 0.3}, "gamepad"},
             {{:move, 0.2, +0.0, 0.3}, "gamepad"},
             # The call itself, which names its node, is sounded first.
             {{:estop, call}, "nonode@nohost"},
             {{:estop, call}, "page 127.0.0.1:5123"},
             {:reset, "page 127.0.0.1:5123"}
           ] = orders(path, id)
  end
end
