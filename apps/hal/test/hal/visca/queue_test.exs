defmodule Hal.Visca.QueueTest do
  use ExUnit.Case, async: true
  alias Hal.Visca.{CommandClass, Queue}
  doctest Hal.Visca.CommandClass
  doctest Hal.Visca.Queue
  doctest Hal.Visca.Queue.Sockets

  defp look(pan), do: {:look, pan, 0, 24, 20}
  @drive {:drive, {:left, 6}, {:stop, 0}}

  # Runs a script of pushes, replies and times; gives all effects, in order.
  defp run(script, queue \\ Queue.new()) do
    {effects, queue} =
      Enum.reduce(script, {[], queue}, fn {now_ms, event}, {all, queue} ->
        {effects, queue} =
          case event do
            {:push, command} -> Queue.push(queue, command, now_ms)
            {:heard, reply} -> Queue.heard(queue, reply, now_ms)
            :tick -> Queue.tick(queue, now_ms)
          end

        {all ++ effects, queue}
      end)

    {effects, queue}
  end

  defp push(ms, command), do: {ms, {:push, command}}
  defp heard(ms, reply), do: {ms, {:heard, reply}}

  test "one message at a time has no answer; both sockets work, and inquiries pass" do
    {effects, queue} =
      run([
        push(0, look(1)),
        push(1, {:zoom_to, 5}),
        push(2, {:ask, :position}),
        heard(20, {:ack, 1}),
        heard(40, {:ack, 2}),
        heard(60, {:result, <<0::64>>}),
        heard(90, {:done, 2}),
        heard(95, {:done, 1})
      ])

    assert effects == [
             {:say, look(1)},
             {:accepted, look(1)},
             {:say, {:zoom_to, 5}},
             {:accepted, {:zoom_to, 5}},
             {:say, {:ask, :position}},
             {:result, :position, {0, 0}, 20},
             {:done, {:zoom_to, 5}},
             {:done, look(1)}
           ]

    assert queue == Queue.new()
    assert Queue.wake_ms(queue) == nil
  end

  test "the newest target replaces one that waits, and of two that work the older is cancelled" do
    {effects, _} =
      run([
        push(0, look(1)),
        push(10, look(2)),
        push(20, look(3)),
        heard(30, {:ack, 1}),
        heard(60, {:ack, 2}),
        push(100, look(4)),
        push(110, look(5)),
        heard(120, {:error, 1, :cancelled}),
        heard(150, {:ack, 1})
      ])

    assert effects == [
             {:say, look(1)},
             {:accepted, look(1)},
             {:say, look(3)},
             {:accepted, look(3)},
             {:say, {:cancel, 1}},
             {:failed, look(1), :cancelled},
             {:say, look(5)},
             {:accepted, look(5)}
           ]
  end

  test "a zoom that works is never cancelled for a look, which waits instead" do
    {effects, queue} =
      run([
        push(0, {:zoom_to, 9}),
        heard(10, {:ack, 1}),
        push(20, {:power, true}),
        heard(30, {:ack, 2}),
        push(40, look(1)),
        push(50, {:ask, :zoom})
      ])

    assert List.last(effects) == {:say, {:ask, :zoom}}
    refute {:say, look(1)} in effects
    {effects, _} = run([heard(60, {:result, <<0::32>>}), heard(70, {:done, 2})], queue)
    assert List.last(effects) == {:say, look(1)}
  end

  test "a drive waits for the end of a move, which is cancelled" do
    {effects, _} =
      run([
        push(0, look(1)),
        heard(10, {:ack, 1}),
        push(20, @drive),
        heard(40, {:error, 1, :cancelled}),
        heard(60, {:ack, 1}),
        heard(61, {:done, 1})
      ])

    assert Enum.drop(effects, 2) == [
             {:say, {:cancel, 1}},
             {:failed, look(1), :cancelled},
             {:say, @drive},
             {:accepted, @drive},
             {:done, @drive}
           ]
  end

  test "no answer: said five times, unless a newer one came; an inquiry and a step once" do
    five = for ms <- 1..9, do: {ms * 120, :tick}
    {effects, _} = run([push(0, look(1)) | five])
    assert Enum.count(effects, &(&1 == {:say, look(1)})) == 5
    assert {:failed, look(1), :no_answer} in effects
    assert :no_answer in effects

    {effects, _} = run([push(0, look(1)), push(10, look(2)), {120, :tick}])
    assert effects == [{:say, look(1)}, {:say, look(2)}]

    step = {:step, 5, 0, 24, 20}
    {effects, _} = run([push(0, step), push(1, {:ask, :power}), {120, :tick}, {240, :tick}])

    assert effects == [
             {:say, step},
             {:failed, step, :no_answer},
             {:say, {:ask, :power}},
             {:failed, {:ask, :power}, :no_answer}
           ]
  end

  test "silence is an error after a second, and any word ends it" do
    {effects, queue} = run([push(0, look(1)), {999, :tick}])
    refute :no_answer in effects
    assert {[:no_answer], _} = run([{1000, :tick}], queue)
    {[], queue} = run([heard(1000, {:error, 2, :no_socket})], %{queue | asked: nil})
    assert queue.silent_ms == nil
    assert {[], _} = run([{1500, :tick}], queue)
  end

  test "full: what is not in the books is cancelled, and the command waits its 50 ms" do
    {effects, queue} = run([push(0, look(1)), heard(20, {:error, 0, :full})])
    assert effects == [{:say, look(1)}, {:say, {:cancel, 1}}]
    {effects, queue} = run([heard(40, {:error, 1, :no_socket})], queue)
    assert effects == []
    assert Queue.wake_ms(queue) == 70
    {effects, _} = run([{70, :tick}, heard(90, {:ack, 1})], queue)
    assert effects == [{:say, look(1)}, {:accepted, look(1)}]
  end

  test "full, or a camera that was switched on: what must not be said twice fails" do
    for command <- [{:step, 9, 0, 24, 20}, {:screen, :toggle}] do
      {effects, queue} = run([push(0, command), heard(20, {:error, 0, :full})])
      assert [{:say, ^command}, {:failed, ^command, :full} | _cancel] = effects
      assert queue.waiting == []

      {effects, queue} = run([push(0, command), heard(20, :network_change)])
      assert effects == [{:say, command}, :network_change, {:failed, command, :no_answer}]
      assert queue.waiting == []
    end
  end

  test "a damaged command is said again; what is not executable, or really wrong, fails" do
    {effects, _} = run([push(0, look(1)), heard(20, {:error, 0, :syntax})])
    assert effects == [{:say, look(1)}, {:say, look(1)}]

    again = for ms <- 1..5, do: heard(20 * ms, {:error, 0, :syntax})
    {effects, _} = run([push(0, look(1)) | again])
    assert List.last(effects) == {:failed, look(1), :syntax}

    {effects, queue} = run([push(0, @drive), heard(20, {:error, 1, :not_executable})])
    assert effects == [{:say, @drive}, {:failed, @drive, :not_executable}]
    assert queue == Queue.new()

    {effects, _} =
      run([push(0, look(1)), heard(9, {:ack, 2}), heard(20, {:error, 2, :not_executable})])

    assert List.last(effects) == {:failed, look(1), :not_executable}
  end

  test "a lost completion frees its socket after 10 s, or as soon as it is needed" do
    {_, queue} = run([push(0, look(1)), heard(20, {:ack, 1})])
    assert Queue.wake_ms(queue) == 10_020

    assert {[{:failed, {:look, 1, 0, 24, 20}, :no_completion}], %{sockets: sockets}} =
             run([{10_020, :tick}], queue)

    assert sockets == %{}

    {effects, _} =
      run(
        [
          push(30, look(2)),
          heard(50, {:ack, 2}),
          push(60, look(3)),
          heard(80, {:error, 1, :no_socket})
        ],
        queue
      )

    assert List.last(effects) == {:say, look(3)}
  end

  test "a cancel that is never answered is said twice, and its socket is free" do
    {_, queue} = run([push(0, look(1)), heard(1, {:ack, 1}), push(2, @drive)])
    {effects, _} = run([{122, :tick}, {242, :tick}], queue)
    assert effects == [{:say, {:cancel, 1}}, {:say, @drive}]
  end

  test "a camera that was switched on has nothing in its sockets, and hears again what it had not answered" do
    {_, queue} = run([push(0, look(1)), heard(1, {:ack, 1}), push(2, {:zoom_to, 3})])
    {effects, queue} = run([heard(3, :network_change)], queue)
    assert effects == [:network_change, {:say, {:zoom_to, 3}}]
    assert queue.sockets == %{}
  end

  test "whatever comes in whatever order: what waits stays bounded, and it never wakes for ever" do
    commands = [look(1), look(2), {:step, 3, 4, 24, 20}, @drive, {:zoom_to, 3}, {:power, true}]
    commands = commands ++ [{:ask, :zoom}, {:ask, :position}, :home, :if_clear, {:cancel, 2}]

    replies =
      for(s <- 1..2, what <- [:ack, :done], do: {what, s}) ++
        for(
          s <- 0..2,
          why <- [:full, :syntax, :cancelled, :no_socket, :not_executable, {:code, 9}],
          do: {:error, s, why}
        ) ++
        [{:result, <<>>}, {:result, <<0::32>>}, {:result, <<0::64>>}, :network_change] ++
        [{:cameras, 1}, :cleared]

    lanes = commands |> Enum.map(&CommandClass.of/1) |> Enum.uniq() |> length()

    for _ <- 1..300 do
      Enum.reduce(1..200, {0, Queue.new()}, fn _, {now_ms, queue} ->
        now_ms = now_ms + :rand.uniform(40)

        {effects, queue} =
          case :rand.uniform(4) do
            1 -> Queue.tick(queue, now_ms)
            2 -> Queue.push(queue, Enum.random(commands), now_ms)
            _ -> Queue.heard(queue, Enum.random(replies), now_ms)
          end

        # One message a time, of those that were pushed or cancels.
        assert Enum.count(effects, &match?({:say, _}, &1)) <= 1
        # A cancel of our own may wait beside one that was pushed.
        assert length(queue.waiting) <= lanes + 1
        assert Enum.all?(Map.keys(queue.sockets), &(&1 in 1..2))
        if queue.waiting != [], do: assert(Queue.wake_ms(queue) != nil)
        {effects, queue} = Queue.tick(queue, now_ms)
        wake_ms = Queue.wake_ms(queue)
        assert wake_ms == nil or wake_ms > now_ms or :no_answer in effects
        {now_ms, queue}
      end)
    end
  end
end
