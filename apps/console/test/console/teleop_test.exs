defmodule Console.TeleopTest do
  use ExUnit.Case, async: true
  alias Console.Teleop
  alias Console.Gamepad
  alias Console.Teleop.{Joystick, Keys}

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

  # A pad of which these bytes were heard at these times.
  defp pad(heard),
    do: Enum.reduce(heard, %Joystick{}, fn {ms, bytes}, pad -> Joystick.take(pad, bytes, ms) end)

  defp released, do: event(0x81, 4, 0) <> event(0x81, 5, 0)
  defp ahead(value \\ 32_767), do: event(2, 1, -value)

  test "pieces of events, and those of no concern, drive nobody" do
    bytes =
      event(0x81, 5, 0) <>
        event(1, 5, 1) <>
        event(2, 7, 99) <> event(1, 0, 1) <> event(9, 1, 1) <> event(2, 0, 16_384)

    pad = pad(for <<byte <- bytes>>, do: {0, <<byte>>})
    assert {+0.0, left} = Joystick.stick(pad, 0)
    assert_in_delta left, -0.5, 0.001
    assert Joystick.stick(Joystick.take(pad, event(1, 5, 0), 1), 1) == nil
  end

  test "a gamepad that tells changes only drives for a second after its last event, of any kind" do
    begun = [{0, released()}, {5_000, event(1, 4, 1) <> ahead()}]
    assert Joystick.stick(pad(begun), 6_000) == {1.0, -0.0}
    assert Joystick.stick(pad(begun), 6_001) == nil
    assert Joystick.pass(pad(begun), 6_001).why == :silent

    # Another button, another axis, the same shoulder pressed anew, the other one.
    for sign <- [
          event(1, 0, 1),
          event(2, 3, 40),
          event(1, 4, 0) <> event(1, 4, 1),
          event(1, 5, 1)
        ] do
      assert {1.0, _left} = Joystick.stick(pad(begun ++ [{5_900, sign}]), 6_900)
      assert Joystick.stick(pad(begun ++ [{5_900, sign}]), 6_901) == nil
    end

    # Four seconds of a hand that trembles.
    trembling = for ms <- 5_000..9_000//250, do: {ms, ahead(30_000 + div(ms, 10))}

    for {ms, _bytes} <- trembling,
        do: assert(Joystick.stick(pad(begun ++ Enum.filter(trembling, &(elem(&1, 0) <= ms))), ms))
  end

  test "a gamepad that says all at a rate drives for 0.3 s after its last report" do
    report = event(1, 4, 1) <> ahead() <> event(2, 0, 0)
    steady = [{0, released()}] ++ for ms <- 1_000..3_000//100, do: {ms, report}
    assert Joystick.stick(pad(steady), 3_300)
    assert Joystick.stick(pad(steady), 3_301) == nil
    assert Joystick.pass(pad(steady), 3_301).why == :silent

    # The same once in a while is no rate.

    rare =
      [{0, released()}, {900, event(1, 4, 1)}] ++ for ms <- 1_000..5_000//500, do: {ms, ahead()}

    assert Joystick.stick(pad(rare), 6_000)
  end

  test "after a silence only a button that was seen up drives; what comes late undoes no silence" do
    begun = [{0, released()}, {0, event(1, 4, 1) <> ahead()}]

    for back <- [
          [],
          [{1_500, ahead(20_000)}],
          [{1_500, event(1, 4, 1)}],
          [{1_500, event(0x81, 4, 1)}]
        ] do
      pad = pad(begun ++ back)
      assert Joystick.stick(pad, 1_600) == nil
      assert Joystick.pass(pad, 1_600).why in [:silent, :not_seen_up]
      pad = Joystick.take(pad, event(1, 4, 0), 2_000)
      assert {pad.why, Joystick.stick(pad, 2_000)} == {nil, nil}
      assert Joystick.stick(Joystick.take(pad, event(1, 4, 1), 2_100), 2_100)
    end
  end

  test "a button that was down at the opening, or was never seen up, drives nobody until it is let go and pressed" do
    for down <- [event(0x81, 4, 1), event(1, 4, 1), event(0x81, 4, 1) <> event(1, 4, 1)] do
      pad = pad([{0, ahead() <> down}])
      assert {pad.why, Joystick.stick(pad, 0)} == {:not_seen_up, nil}
      pad = Joystick.take(pad, event(1, 4, 0), 100)
      assert {pad.why, Joystick.stick(pad, 100)} == {nil, nil}
      assert Joystick.stick(Joystick.take(pad, event(1, 4, 1), 200), 200)
      # The other one is free.
      pad = pad([{0, released() <> ahead() <> down}, {100, event(1, 5, 1)}])
      assert Joystick.stick(pad, 100)
    end
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

  test "keys whose sequences end like those of driving drive nobody" do
    # Arrows with Ctrl and Alt; F1 to F5 of xterm, rxvt and the Linux console; Home, Delete, a paste, Shift and Tab.
    others =
      ~w([1;5A [1;5D [1;3D OP OQ OR OS [11~ [15~ [[A [[D [[E [H OH [3~ [200~ [1;2S [Z) ++
        ["[24;5~"]

    for other <- others, escape <- ["\e", "\e\e"] do
      {said, keys} =
        Enum.map_reduce(String.graphemes(escape <> other), Keys.new(:mag1), &Keys.key(&2, &1))

      assert {Enum.uniq(said), other} == {[nil], other}
      # What comes next is itself.
      assert {{:word, {0.6, +0.0}}, _keys} = Keys.key(keys, "w")
    end

    # F8, with Shift or without.
    for f8 <- ["\e[19~", "\e[19;2~"] do
      {said, _keys} = Enum.map_reduce(String.graphemes(f8), Keys.new(:mag1), &Keys.key(&2, &1))
      assert List.last(said) == :estop
    end

    # A person who types in the middle of one stands and stops all the same.
    {_said, keys} = Enum.map_reduce(["\e", "["], Keys.new(:mag1), &Keys.key(&2, &1))
    assert {{:word, {+0.0, +0.0}}, _keys} = Keys.key(keys, " ")
    assert {:estop, _keys} = Keys.key(keys, "e")
    assert {:leave, _keys} = Keys.key(keys, <<3>>)
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
      :ok = :file.write(device, released() <> event(0x82, 1, 0) <> ahead())
      :ok = :file.write(device, event(1, 4, 1))
      for _word <- 1..3, do: assert_receive({:told, {:tell, [:mag1], {:move, 0.5, _, _}}})
      :ok = :file.write(device, event(1, 4, 0))
      assert_receive {:told, {:tell, [:mag1], {:move, v, w, _}}} when v == 0 and w == 0

      # One that is pulled out while it drives is let go.
      :ok = :file.write(device, event(1, 4, 1))
      assert_receive {:told, {:tell, [:mag1], {:move, 0.5, _, _}}}
      ref = Process.monitor(pad)
      :ok = :file.close(device)
      assert_receive {:told, {:tell, [:mag1], {:move, v, w, _}}} when v == 0 and w == 0
      assert_receive {:line, "the gamepad at " <> _}
      assert_receive {:DOWN, ^ref, :process, ^pad, :normal}
    end

    # What it is told until then.
    defp speeds(until_ms) do
      receive do
        {:told, {:tell, [:mag1], {:move, v, _, _}}} -> [v | speeds(until_ms)]
      after
        max(until_ms - System.monotonic_time(:millisecond), 0) -> []
      end
    end

    test "that falls silent stands, says why once, and drives again after a new press", %{
      path: path
    } do
      test = self()
      tell = &send(test, {:line, &1})
      options = [module: Fleet, live: test, robot: :mag1, path: path, tell: tell]
      {:ok, _pad} = Gamepad.start_link(options)
      {:ok, device} = File.open(path, [:write, :raw])
      :ok = :file.write(device, released() <> ahead() <> event(1, 4, 1))
      assert_receive {:told, {:tell, [:mag1], {:move, 0.5, _, _}}}
      assert_receive {:told, {:tell, [:mag1], {:move, v, w, _}}} when v == 0 and w == 0, 10_000
      assert_receive {:line, "mag1 stands: the gamepad said nothing for 1.0 s. Let go" <> _}
      # Also where the stick moves again, with the button down.
      :ok = :file.write(device, ahead(20_000))
      told = speeds(System.monotonic_time(:millisecond) + 500)
      refute Enum.any?(told, &(&1 >= 0.3 and &1 < 0.4))
      :ok = :file.write(device, event(1, 4, 0) <> event(1, 4, 1))
      assert_receive {:told, {:tell, [:mag1], {:move, v, _, _}}} when v >= 0.3 and v < 0.4
      refute_received {:line, _again}
    end

    test "what is none is refused in a line" do
      start = &Gamepad.start_link(module: Fleet, live: self(), robot: :mag1, path: &1, tell: &1)
      assert {:error, "no gamepad at /nowhere/js0 (no such file" <> _} = start.("/nowhere/js0")
      assert {:error, line} = start.(__ENV__.file)
      assert line =~ "is no gamepad; /dev/input/js0 is the first"
    end
  end
end
