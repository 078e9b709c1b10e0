defmodule Console.OrdersTest do
  @moduledoc "What a person orders has an age, and a stop goes past it."
  use ExUnit.Case, async: true
  # An order may wait for half a second only, of the real clock.
  @moduletag :realtime
  alias Console.{Orders, Prompt}
  alias Console.Page.Line

  doctest Prompt.Stop
  doctest Line

  defmodule Slow do
    @moduledoc "A fleet that says what it is told, and answers when the test says so."
    @spec command(pid(), term()) :: {:ok, String.t()}
    def command(test, command) do
      ref = make_ref()
      send(test, {:told, command, {self(), ref}})

      receive do
        {^ref, answer} -> answer
      end
    end
  end

  defp now_us, do: System.monotonic_time(:microsecond)

  defp orders do
    test = self()
    {:ok, orders} = Orders.start_link("a test", &send(test, {:answer, &1, &2}))
    orders
  end

  defp line(orders, text, given_us \\ now_us()) do
    {:ok, command} = Prompt.parse(text, [:mag1, :mag2])
    Orders.give(orders, Orders.of_line(text, command, {Slow, self()}, given_us))
  end

  defp word(orders, stick, given_us \\ now_us()),
    do: Orders.give(orders, Orders.of_word(:mag1, stick, :page, {Slow, self()}, given_us))

  defp answer({pid, ref}, answer \\ {:ok, "done"}), do: send(pid, {ref, answer})

  test "the presence of a person is said beside all that waits, one word at a time, and never answered" do
    orders = orders()
    line(orders, "goto mag1 1,1")
    assert_receive {:told, {:tell, [:mag1], {:goto, 1.0, 1.0, nil}}, first}
    test = self()

    say = fn ->
      run = fn _age_ms -> Slow.command(test, :present) end
      Orders.give(orders, %{Orders.of_presence(now_us()) | run: run})
    end

    say.()
    assert_receive {:told, :present, word}
    say.()
    answer(first)
    assert_receive {:answer, "goto mag1 1,1", {:ok, "done"}}
    refute_received {:told, :present, _second}
    answer(word)
    Orders.settle(orders)
    say.()
    assert_receive {:told, :present, word}
    answer(word, {:error, "mag1 does not answer"})
    Orders.settle(orders)
    refute_received {:answer, "present", _line}
    assert {:ok, %{kind: :present}} = Line.order("present", now_us(), [:mag1], {Slow, self()})
    assert {:error, _line} = Line.order("present", nil, [:mag1], {Slow, self()})
  end

  test "orders run one after the other; a stop goes past them, and drops those that wait" do
    orders = orders()
    for text <- ["goto mag1 1,1", "goto mag1 2,2", "start"], do: line(orders, text)
    assert_receive {:told, {:tell, [:mag1], {:goto, 1.0, 1.0, nil}}, first}
    refute_received {:told, _next, _ref}

    line(orders, "stop")
    assert_receive {:told, {:tell, :all, :stop}, stop}
    assert_receive {:answer, "goto mag1 2,2", {:error, "not carried out: stopped" <> _}}
    assert_receive {:answer, "start", {:error, "not carried out: stopped" <> _}}

    # One stop more while that one is under way is not lost, but follows it.
    line(orders, "stop all")
    line(orders, "estop")
    assert_receive {:told, :estop, estop}
    refute_received {:told, _again, _ref}
    answer(stop)
    assert_receive {:answer, "stop", {:ok, "done"}}
    assert_receive {:told, {:tell, :all, :stop}, again}
    for ref <- [first, estop, again], do: answer(ref)
    Orders.settle(orders)
    for text <- ["goto mag1 1,1", "estop", "stop all"], do: assert_received({:answer, ^text, _})
    refute_received {:told, _nothing_else, _ref}
  end

  test "a reset does not overtake an emergency stop, and a question waits for none" do
    orders = orders()
    line(orders, "estop")
    assert_receive {:told, :estop, estop}
    {:ok, question} = Line.order("help", nil, [:mag1], {Console.Live.Fleet, nil})
    Orders.give(orders, %{question | given_us: now_us()})
    assert_receive {:answer, "help", {:ok, [_line | _more]}}

    line(orders, "reset")
    line(orders, "stop mag2")
    assert_receive {:told, {:tell, [:mag2], :stop}, stop}
    assert_receive {:answer, "reset", {:error, "not carried out: stopped" <> _}}
    line(orders, "reset")
    answer(stop)
    assert_receive {:answer, "stop mag2", {:ok, "done"}}
    Orders.give(orders, %{question | given_us: now_us()})
    assert_receive {:answer, "help", {:ok, [_line | _more]}}
    refute_received {:told, :reset, _ref}

    answer(estop)
    assert_receive {:told, :reset, reset}
    assert_received {:answer, "estop", {:ok, "done"}}
    answer(reset)
    assert_receive {:answer, "reset", {:ok, "done"}}
  end

  test "an order that has waited for half a second is not carried out; a stop and a question are" do
    orders = orders()
    line(orders, "start", now_us() - 600_000)
    assert_receive {:answer, "start", {:error, refusal}}
    assert refusal =~ ~r/^given \d+\.\d s ago and not carried out: at most 0\.5 s are allowed/

    line(orders, "stop mag2", now_us() - 60_000_000)
    assert_receive {:told, {:tell, [:mag2], :stop}, stop}
    answer(stop)

    {:ok, question} = Line.order("help", nil, [:mag1], {Console.Live.Fleet, nil})
    Orders.give(orders, %{question | given_us: now_us() - 60_000_000})
    assert_receive {:answer, "help", {:ok, [_line | _more]}}
  end

  test "what is carried out counts as given when it was, also where it waits there" do
    orders = orders()
    given_us = now_us() - 200_000
    test = self()

    run = fn age_ms ->
      {:ok, send(test, {:ran, age_ms, Swarm.Commands.Client.given_us()}) && "x"}
    end

    Orders.give(orders, %{kind: :order, key: 1, line: "x", given_us: given_us, run: run})
    assert_receive {:ran, age_ms, ^given_us} when age_ms >= 200
  end

  test "twenty thousand orders hold eight, and the newest are kept" do
    orders = orders()
    line(orders, "start")
    assert_receive {:told, _start, start}
    for n <- 1..20_000, do: line(orders, "goto mag1 1,#{rem(n, 9)}")
    line(orders, "goto mag2 3,3")
    answer(start)
    test = self()
    _task = Task.async(fn -> :ok = Orders.settle(orders) && send(test, :settled) end)

    told = told([])
    assert length(told) <= 8
    assert {:tell, [:mag2], {:goto, 3.0, 3.0, nil}} = List.last(told)
    assert {:message_queue_len, 0} = Process.info(orders, :message_queue_len)
  end

  defp told(commands) do
    receive do
      {:told, command, ref} ->
        answer(ref)
        told([command | commands])

      :settled ->
        Enum.reverse(commands)
    end
  end

  test "words of driving: the newest of a robot counts, an old one moves nothing, one ends when it was to" do
    orders = orders()
    line(orders, "start")
    assert_receive {:told, _start, start}
    for n <- 1..5, do: word(orders, {n / 5, 0.0})
    answer(start)
    assert_receive {:told, {:tell, [:mag1], {:move, 0.5, turn, for_s}}, ref}
    assert for_s <= 0.3 and turn == 0
    answer(ref)
    Orders.settle(orders)
    refute_received {:told, _word, _ref}

    word(orders, {1.0, 0.0}, now_us() - 300_000)
    Orders.settle(orders)
    refute_received {:told, _word, _ref}
    assert_received {:answer, "start", _done}
    refute_received {:answer, "drive", _silence}
  end

  test "a line of the page says when it was given; only a stop and a question need not" do
    source = {Slow, self()}
    order = &Line.order(&1, &2, [:mag1], source)
    assert {:ok, %{kind: :order, given_us: 5}} = order.("start", 5)

    for text <- ["start", "goto mag1 1,2", "drive mag1 1 0", "reset"] do
      assert {:error, "an order must say when it was given" <> _} = order.(text, nil)
    end

    for text <- ["stop", "estop now", "disarm all"],
        do: assert({:ok, %{kind: :stop}} = order.(text, nil))

    assert {:ok, %{kind: :question}} = order.("status", nil)
    assert {:look, :mag1} = order.("look mag1", nil)
    assert {:look, nil} = order.("look", nil)

    for line <- ["@", "@x stop", "@ stop", "@1e9 stop"],
        do: assert({^line, nil} = Line.given(line, 7))
  end
end
