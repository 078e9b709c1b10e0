defmodule Swarm.Comms.JoystickTest do
  @moduledoc "A robot that is driven by its base's own joystick: the word as a function, and live with a fake drive."
  use Swarm.Case, async: false
  alias Swarm.Comms.Joystick
  doctest Swarm.Comms.Joystick
  @moduletag :realtime
  @moduletag :capture_log

  defp stick(linear, turn, held?), do: %{twist: Twist.new(linear, turn), held?: held?}

  # The words for readings, each heard at its time and looked at 20 ms later.
  defp words(readings) do
    {words, _joystick} =
      Enum.map_reduce(readings, %Joystick{}, fn
        {at_ms, nil}, joystick -> Joystick.word(joystick, nil, at_ms)
        {at_ms, reading}, joystick -> Joystick.word(joystick, {reading, at_ms}, at_ms + 20)
      end)

    words
  end

  test "only a held button drives, and the first look after it is let go is a word to stand" do
    assert [
             nil,
             {:move, 0.3, 0.5, 0.28},
             {:move, +0.0, +0.0, 0.28},
             {:move, +0.0, +0.0, 0.28},
             nil
           ] =
             words([
               {0, stick(0.3, 0.5, false)},
               {100, stick(0.3, 0.5, true)},
               {200, stick(0.04, -0.09, true)},
               {300, stick(0.3, 0.5, false)},
               {400, stick(0.3, 0.5, false)}
             ])
  end

  test "a button that was down before it was heard, or through a silence, must be let go first" do
    assert [nil, nil, nil, {:move, 0.3, +0.0, 0.28}, nil, nil, nil, {:move, 0.3, +0.0, 0.28}] =
             words([
               {0, stick(0.3, 0, true)},
               {100, stick(0.3, 0, true)},
               {200, stick(0, 0, false)},
               {300, stick(0.3, 0, true)},
               {700, nil},
               {800, stick(0.3, 0, true)},
               {900, stick(0.3, 0, false)},
               {1_000, stick(0.3, 0, true)}
             ])
  end

  test "a hand is limited, and what is no reading is silence" do
    assert [nil, {:move, 0.5, -1.0, _}, nil, nil] =
             words([
               {0, stick(0, 0, false)},
               {100, stick(2_000, -90, true)},
               {200, %{twist: %Twist{linear: :nan, turn: 0.0}, held?: true}},
               {300, %{x: 1, y: 2, buttons: 1}}
             ])
  end

  # Says ten times a second what the stick says, which the returned function changes; first that its button is up.
  defp held(id) do
    hand =
      start_supervised!(
        {Agent, fn -> stick(0, 0, false) end},
        id: {:hand, id}
      )

    start_supervised!(
      {Task,
       fn ->
         100
         |> Stream.interval()
         |> Enum.each(fn _n ->
           reading = Agent.get(hand, & &1)
           drive = Names.whereis(id, :drive)
           if reading && drive, do: send(drive, {:readings, [{:joystick, reading}]})
         end)
       end},
      id: {:says, id}
    )

    eventually(fn ->
      match?({:ok, %{held?: false}, _}, Board.fetch(Board.find!(id), :joystick, 300))
    end)

    fn reading -> Agent.update(hand, fn _before -> reading end) end
  end

  defp told(id, wanted?) do
    pid = Names.whereis(id, :drive)
    assert_receive {:drive, {:drive, %Twist{linear: v}}, ^pid} when is_float(v), 10_000
    wanted?.(v) || told(id, wanted?)
  end

  defp drives(id), do: told(id, &(&1 > 0.1))
  defp stands(id), do: told(id, &(&1 == 0))

  # From now on no speed but zero is told, twenty times in a row.
  defp still(id) do
    pid = Names.whereis(id, :drive)
    heard(pid)

    for _look <- 1..20 do
      assert_receive {:drive, {:drive, twist}, ^pid}, 1_000
      assert Twist.zero?(twist)
    end
  end

  # What was told until now.
  defp heard(pid) do
    receive do
      {:drive, _said, ^pid} -> heard(pid)
    after
      0 -> :ok
    end
  end

  test "the robot drives while the button is held, and stands when it is let go or the joystick is silent" do
    id = robot(:joystick)
    standing([id])
    hand = held(id)

    hand.(stick(0.3, 0, true))
    drives(id)
    hand.(stick(0.3, 0, false))
    stands(id)
    hand.(stick(0.3, 0, true))
    drives(id)
    # Its cable is cut with the button down.
    hand.(nil)
    stands(id)
    eventually(fn -> Board.fetch(Board.find!(id), :joystick, 300) == :error end)
    hand.(stick(0.3, 0, true))
    still(id)
  end

  test "it moves nothing that is held or not armed, and says why once" do
    id = robot(:joystick_unarmed, arm: :manual)
    standing([id])
    hand = held(id)
    listen(id, [:swarm, :comms, :joystick])

    hand.(stick(0.3, 0, true))
    assert_receive {[:swarm, :comms, :joystick], %{line: line}}, 10_000
    assert line =~ "joystick_unarmed: its wheels are disarmed; arm it first"
    still(id)
    refute_received {[:swarm, :comms, :joystick], %{line: ^line}}
    eventually(fn -> Swarm.arm(id) == :ok end)
    # What was held meanwhile is let go first.
    still(id)
    again(hand, id)
    eventually(fn -> Swarm.estop() == :ok end)
    stands(id)
    assert_receive {[:swarm, :comms, :joystick], %{line: held}}, 10_000
    assert held =~ "held by the emergency stop"
    eventually(fn -> Swarm.reset() == :ok end)
    still(id)
    again(hand, id)
  end

  defp again(hand, id) do
    hand.(stick(0, 0, false))
    still(id)
    hand.(stick(0.3, 0, true))
    drives(id)
  end

  test "a hand at it is a person who is there" do
    id = robot(:joystick_attended, presence: 0.6)
    standing([id])
    hand = held(id)
    listen(id, [:swarm, :comms, :joystick])

    assert {:error, _needs_a_person} = Swarm.tell(id, "move:0.2:0")
    hand.(stick(0.3, 0, true))
    drives(id)
    # The first word came before the person was known.
    refute_received {[:swarm, :comms, :joystick], _about}
  end
end
