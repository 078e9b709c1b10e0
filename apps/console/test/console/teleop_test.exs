defmodule Console.TeleopTest do
  use ExUnit.Case, async: true
  alias Console.Teleop
  alias Console.Teleop.{Gamepad, Joystick, Keys}

  doctest Teleop
  doctest Joystick
  doctest Keys

  # A fleet that tells a test what it was told.
  defmodule Fleet do
    def command(test, command) do
      send(test, {:told, command})
      {:ok, "accepted"}
    end
  end

  # By the fact of Linux's joystick interface, not by the code under test.
  defp event(type, number, value), do: <<0::32, value::little-signed-16, type, number>>

  test "pieces of events, and those of no concern, drive nobody" do
    bytes = event(0x81, 5, 1) <> event(2, 7, 99) <> event(1, 0, 1) <> event(2, 0, 16_384)
    pad = for <<byte <- bytes>>, reduce: %Joystick{}, do: (pad -> Joystick.take(pad, <<byte>>))
    assert {+0.0, left} = Joystick.stick(pad)
    assert_in_delta left, -0.5, 0.001
    assert Joystick.stick(Joystick.take(pad, event(1, 5, 0))) == nil
    assert map_size(pad.axes) == 1
  end

  test "arrows of both kinds drive; a lone escape is forgotten; the share has bounds" do
    typed = fn text, keys ->
      Enum.map_reduce(String.graphemes(text), keys, fn char, keys -> Keys.key(keys, char) end)
    end

    keys = Keys.new(:mag1)
    assert {[nil, nil, {:word, {0.6, +0.0}}], _keys} = typed.("\e[A", keys)
    assert {[nil, nil, {:word, {-0.6, +0.0}}], _keys} = typed.("\eOB", keys)
    assert {[nil, {:word, {-0.6, +0.0}}], _keys} = typed.("\es", keys)
    assert {_speeds, %{share: 1.0}} = typed.("++++++", keys)
    assert {_speeds, %{share: share} = slow} = typed.("------", keys)
    assert_in_delta share, 0.2, 1.0e-9
    assert Keys.hint(slow) =~ "at 20 %"
    assert {[:estop, :leave], _keys} = typed.("eq", keys)
  end

  describe "a gamepad" do
    @describetag :realtime

    setup do
      path = Path.join(System.tmp_dir!(), "convoy-js-#{System.unique_integer([:positive])}")
      {_out, 0} = System.cmd("mkfifo", [path])
      on_exit(fn -> File.rm(path) end)
      %{path: path}
    end

    test "drives while a shoulder button is held, stops when it is let go, and tells when it is gone",
         %{path: path} do
      test = self()
      tell = &send(test, {:line, &1})

      {:ok, pad} =
        Gamepad.start_link(module: Fleet, live: test, robot: :mag1, path: path, tell: tell)

      # Whoever opens a fifo to write waits until somebody reads.
      {:ok, device} = File.open(path, [:write, :raw])
      :ok = :file.write(device, event(0x82, 1, 0) <> event(2, 1, -32_767))
      :ok = :file.write(device, event(1, 4, 1))
      for _word <- 1..3, do: assert_receive({:told, {:tell, [:mag1], "move:0.5:" <> _}})
      :ok = :file.write(device, event(1, 4, 0))
      assert_receive {:told, {:tell, [:mag1], "move:0.0:0.0:0.3"}}

      # One that is pulled out while it drives is let go.
      :ok = :file.write(device, event(1, 4, 1))
      assert_receive {:told, {:tell, [:mag1], "move:0.5:" <> _}}
      ref = Process.monitor(pad)
      :ok = :file.close(device)
      assert_receive {:told, {:tell, [:mag1], "move:0.0:0.0:0.3"}}
      assert_receive {:line, "the gamepad at " <> _}
      assert_receive {:DOWN, ^ref, :process, ^pad, :normal}
    end

    test "what is none is refused in a line" do
      start = &Gamepad.start_link(module: Fleet, live: self(), robot: :mag1, path: &1, tell: &1)
      assert {:error, "no gamepad at /nowhere/js0 (no such file" <> _} = start.("/nowhere/js0")
      assert {:error, line} = start.(__ENV__.file)
      assert line =~ "is no gamepad; /dev/input/js0 is the first"
    end
  end
end
