defmodule Hal.Device.ArmingTest do
  use ExUnit.Case, async: true
  alias Hal.{Device, Odometry, Pose, Twist}
  alias Hal.Device.Arming
  @moduletag :realtime
  doctest Hal.Device.Arming

  @zero Twist.zero()
  @ahead Twist.new(0.3, 0.0)

  # One of all things that can happen to wheels.
  @events [
    {:order, :arm, :ok},
    {:order, :arm, {:error, "angle is missing"}},
    {:order, :disarm, :ok},
    {:order, :acknowledge, :ok},
    {:ready, :ok},
    {:ready, {:error, "angle is missing"}},
    {:told, Twist.new(0.3, 0.0)},
    {:told, Twist.zero()},
    {:lost, :eio}
  ]

  defp apply_event(arming, {:order, order, ready}),
    do: arming |> Arming.order(order, ready) |> elem(1)

  defp apply_event(arming, {:ready, ready}), do: Arming.ready(arming, ready)
  defp apply_event(arming, {:told, twist}), do: Arming.told(arming, twist)
  defp apply_event(arming, {:lost, reason}), do: Arming.lost(arming, reason)

  test "with :manual, only an order of a person arms, and only an acknowledgement leaves an error" do
    for first <- @events, second <- @events, third <- @events, fourth <- @events do
      Enum.reduce([first, second, third, fourth], Arming.new(:manual), fn event, before ->
        now = apply_event(before, event)

        if now.state == :armed and before.state != :armed,
          do: assert(event == {:order, :arm, :ok} and before.state == :disarmed)

        if match?({:error, _}, before.state) and now.state != before.state,
          do: assert(event == {:order, :acknowledge, :ok} and now.state == :disarmed)

        # What is not armed is told nothing but to stand.
        {twist, counted} = Arming.drive(now, @ahead)
        assert now.state == :armed or twist == @zero
        assert counted.refused - now.refused == if(now.state == :armed, do: 0, else: 1)
        now
      end)
    end
  end

  test "with :never, nothing that happens arms" do
    for first <- @events, second <- @events, third <- @events do
      Enum.reduce([first, second, third], Arming.new(:never), fn event, before ->
        now = apply_event(before, event)
        assert {now.state, now.why} == {:disarmed, "this is a dry run: the wheels stand"}
        now
      end)
    end
  end

  test "with :auto, what a person disarmed is armed by a person only, also after the line was lost" do
    auto = Arming.new(:auto) |> Arming.ready(:ok)
    {:ok, held} = Arming.order(auto, :disarm, :ok)
    held = held |> Arming.ready(:ok) |> Arming.lost(:eio) |> Arming.ready(:ok)
    assert held.state == :disarmed
    assert {:ok, %{state: :armed}} = Arming.order(held, :arm, :ok)
  end

  test "wheels that still roll when the line is lost are an error, standing ones are not" do
    {:ok, armed} = Arming.order(Arming.new(:manual), :arm, :ok)

    for {twist, state} <- [
          {Twist.new(0.0, 0.0), :disarmed},
          {Twist.new(0.005, -0.01), :disarmed},
          {Twist.new(-0.1, 0.0), {:error, :unplugged}},
          {Twist.new(0.0, 0.3), {:error, :unplugged}}
        ] do
      odometry = {:odometry, %Odometry{pose: Pose.new(0, 0), twist: twist}}
      rolled = armed |> Arming.told(@ahead) |> Arming.told(@zero) |> Arming.measured(odometry)
      assert Arming.lost(rolled, :unplugged).state == state
    end
  end

  test "what is not a speed was no speed to be lost at" do
    {:ok, armed} = Arming.order(Arming.new(:manual), :arm, :ok)

    assert Arming.lost(Arming.told(armed, %Twist{linear: :nan, turn: 0.0}), :eio).state ==
             :disarmed
  end

  test "a drive that did not answer in time is not armed when it comes to it" do
    pid = drive([], arm: :manual)
    :ok = :sys.suspend(pid)
    assert {:error, "the drive does not answer"} = Device.arm(pid)
    :ok = :sys.resume(pid)
    assert %{state: :disarmed} = Device.arming(pid)
    assert Device.arm(pid) == :ok
  end

  test "an order to arm lapses before its caller gives up, so that nothing is armed without an answer" do
    test = self()

    device =
      start_supervised!(
        {Task,
         fn ->
           receive do
             {:"$gen_call", from, {:arm, until_ms}} ->
               send(test, {:left_ms, until_ms - System.monotonic_time(:millisecond)})
               GenServer.reply(from, :ok)
           end
         end}
      )

    assert Device.arm(device) == :ok
    assert_received {:left_ms, left_ms} when left_ms <= 300
  end

  test "who hands an order on does not wait, and the device answers for it, but for one that is too late" do
    pid = drive([], arm: :manual)
    :ok = :sys.suspend(pid)
    now_ms = System.monotonic_time(:millisecond)
    answer = fn name -> {__MODULE__, :answer, [self(), name]} end
    assert Device.order_later(pid, :arm, now_ms, answer.(:late)) == :ok
    assert Device.order_later(pid, :disarm, now_ms + 60_000, answer.(:disarmed)) == :ok
    assert Device.order_later(pid, :arm, now_ms + 60_000, answer.(:armed)) == :ok
    refute_received {:late, _answer}
    :ok = :sys.resume(pid)
    assert_receive {:late, {:error, "the drive answers too late"}}
    assert_receive {:disarmed, :ok}
    assert_receive {:armed, :ok}
    assert Device.arming(pid).state == :armed

    ptz =
      start_supervised!({Device, kind: :ptz, driver: {Hal.FakePtz, test: self(), device: :ptz}})

    Device.order_later(ptz, :arm, now_ms + 60_000, answer.(:ptz))
    assert_receive {:ptz, {:error, "a ptz has no wheels that could be armed"}}
  end

  @doc false
  def answer(test, name, answer), do: send(test, {name, answer})

  defp drive(options, device \\ []) do
    driver = {Hal.FakeDrive, [test: self(), device: :drive] ++ options}
    device = [kind: :drive, driver: driver, sinks: [{Kernel, :send, [self()]}]] ++ device
    pid = start_supervised!({Device, device})
    # Before its base has reported nobody arms it.
    unless options[:open], do: assert_receive({:health, :drive, {:online, _}})
    pid
  end

  defp switch(value) do
    {:ok, agent} = Agent.start_link(fn -> value end)
    {agent, fn -> Agent.get(agent, & &1) end}
  end

  test "a drive that arms by itself does so when it is open and ready, and says what is missing" do
    {agent, ready} = switch({:error, "distance is missing"})
    pid = drive(ready: ready)
    assert_receive {:arming, %{state: :disarmed, why: "distance is missing"}}
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @zero
    assert Device.arm(pid) == {:error, "distance is missing"}
    Agent.update(agent, fn _ -> :ok end)
    send(pid, {:readings, []})
    assert_receive {:arming, %{state: :armed, why: nil}}
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @ahead
    assert Device.arming(pid).refused == 1
  end

  test "a drive armed by hand stands until then; disarming stops it at once; each start begins disarmed" do
    pid = drive([], arm: :manual)
    assert_receive {:arming, %{state: :disarmed, why: nil}}
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @zero
    assert Device.arm(pid) == :ok
    assert_receive {:arming, %{state: :armed}}
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @ahead
    assert Device.disarm(pid) == :ok
    # Before the answer, not some time after it.
    assert_received {:drive, {:drive, twist}, ^pid} when twist == @zero
    assert_received {:arming, %{state: :disarmed}}
    assert Device.arm(pid) == :ok
    assert Device.disarm_later(pid) == :ok
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @zero
    assert Device.arm(pid) == :ok

    stop_supervised!({Device, :drive})
    again = drive([], arm: :manual)
    assert Device.arming(again).state == :disarmed
  end

  test "a line lost in motion is an error until a person acknowledges" do
    pid = drive([], arm: :manual)
    assert Device.arm(pid) == :ok
    Device.drive(pid, @ahead)
    send(pid, {:fail, :unplugged})
    assert_receive {:arming, %{state: {:error, :unplugged}}}
    # It is open again by itself, and still stands.
    assert_receive {:health, :drive, {{:offline, :unplugged}, _}}
    assert_receive {:health, :drive, {:online, _}}
    assert {:error, line} = Device.arm(pid)
    assert line =~ "acknowledge"
    forget()
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @zero
    assert Device.acknowledge(pid) == :ok
    assert_receive {:arming, %{state: :disarmed}}
    assert Device.arm(pid) == :ok
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @ahead
  end

  test "a stop that the line does not take any more is a line lost in motion" do
    {agent, told} = switch(:ok)
    pid = drive([told: told], arm: :manual)
    assert Device.arm(pid) == :ok
    Device.drive(pid, @ahead)
    assert_receive {:drive, {:drive, twist}, ^pid} when twist == @ahead
    Agent.update(agent, fn _ -> {:error, :eio} end)
    lost = "the line was lost (:eio) while the wheels turned"
    assert Device.disarm(pid) == {:error, lost}
    assert_received {:arming, %{state: {:error, :eio}}}
  end

  test "what is offline cannot be armed, and says why; what has no wheels neither" do
    pid = drive([open: fn -> {:error, :enoent} end], arm: :manual)
    assert_receive {:arming, %{state: :disarmed}}
    assert Device.arm(pid) == {:error, "the drive is offline (:enoent)"}
    assert Device.acknowledge(pid) == :ok

    driver = {Hal.FakePtz, test: self(), device: :ptz}
    ptz = start_supervised!({Device, kind: :ptz, driver: driver})
    assert Device.arm(ptz) == {:error, "a ptz has no wheels that could be armed"}
    assert Device.arming(ptz) == nil

    :ok = stop_supervised!({Device, :ptz})
    assert Device.disarm(ptz) == {:error, "the drive does not answer"}
  end

  test "a wrong policy is named" do
    assert_raise ArgumentError,
                 ~r/arm: expected :auto, :manual or :never, got :hand/,
                 fn ->
                   Device.start_link(kind: :drive, driver: {Hal.FakeDrive, []}, arm: :hand)
                 end
  end

  defp forget do
    receive do
      {:drive, _what, _pid} -> forget()
    after
      0 -> :ok
    end
  end
end
