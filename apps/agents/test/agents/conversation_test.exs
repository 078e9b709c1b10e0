defmodule Agents.ConversationTest do
  use Swarm.Case, async: false
  alias Agents.{Conversation, Envelope, Responder}
  alias Agents.Answerers

  defp service(name, service \\ :echo) do
    options = [service: service, module: Answerers.Echo]
    pid = start_supervised!({Responder, {name, options}}, id: {name, service})
    # The previous test may have ended the directory.
    eventually(fn -> pid in Directory.members({:service, service, name}) end)
    {name, service}
  end

  defp question(content), do: Envelope.new(:query, :asker, content)

  defp nothing_left, do: assert(Process.info(self(), :messages) == {:messages, []})

  test "a peer that is asked answers, is silent, is unknown, refuses, or ends" do
    peer = service(:talk1)
    asked = question(:battery)
    assert {:ok, answer} = Conversation.request(peer, asked)
    assert %{performative: :inform, from: :talk1, content: :battery} = answer
    assert answer.conversation == asked.conversation

    assert Conversation.request(peer, question(:silent), 30) == {:error, :no_answer}
    assert Conversation.request({:nobody, :echo}, question(1)) == {:error, :unknown}
    assert Conversation.request({:talk1, :other}, question(1)) == {:error, :unknown}
    assert Conversation.request("talk1", question(1)) == {:error, :unknown}
    assert Conversation.tell({:nobody, :echo}, question(1)) == {:error, :unknown}
    assert Conversation.request(peer, question(:die), 5_000) == {:error, :gone}
    nothing_left()
  end

  test "code that raises causes a failure as answer and an event, and goes on" do
    listener = self()

    :ok =
      Hal.Event.attach(
        __MODULE__,
        [:swarm, :responder, :failure],
        fn _, _, meta, _ -> send(listener, meta) end,
        nil
      )

    on_exit(fn -> Hal.Event.detach(__MODULE__) end)
    peer = service(:talk2)
    pid = Names.whereis(:talk2, {:service, :echo})

    for content <- [:raise, :nonsense] do
      assert {:ok, %{performative: :failure}} = Conversation.request(peer, question(content))
      assert_receive %{robot: :talk2, service: :echo, kind: :error}
    end

    for term <- [:junk, %{question(1) | epoch: -1}, {:x, 1}], do: send(pid, term)
    GenServer.cast(pid, :junk)
    send(pid, {:"$gen_call", {self(), make_ref()}, :junk})
    assert {:ok, %{content: 1}} = Conversation.request(peer, question(1))
    assert %{rejected: 3, waiting: 0} = Responder.counts(pid)
  end

  test "many are asked, completely, partially and with a quorum" do
    peers = for n <- 1..5, do: service(:"talk_many#{n}")
    all = Conversation.gather(peers, question(7), 5_000)
    assert {:complete, answers, []} = all
    assert Enum.sort(Map.keys(answers)) == peers
    assert Enum.all?(answers, fn {{name, :echo}, a} -> {a.from, a.content} == {name, 7} end)

    assert {:partial, answers, missing} =
             Conversation.gather([{:nobody, :echo} | peers], question(7), 5_000)

    assert {map_size(answers), missing} == {5, [{:nobody, :echo}]}

    for {quorum, least, state} <- [
          {1, 1, :complete},
          {:majority, 4, :complete},
          {0, 0, :complete},
          {6, 5, :partial}
        ] do
      assert {^state, answers, missing} =
               Conversation.gather([{:nobody, :echo} | peers], question(7), 5_000, quorum)

      assert map_size(answers) >= least
      assert map_size(answers) + length(missing) == 6
    end

    assert Conversation.gather([], question(1), 100) == {:complete, %{}, []}

    assert {:partial, %{}, [_, _]} =
             Conversation.gather(Enum.take(peers, 2), question(:silent), 0)

    nothing_left()
  end

  test "nobody waits for peers that leave meanwhile" do
    [quick, silent, dying] = for n <- 1..3, do: service(:"talk_leave#{n}")
    {:ok, idle} = Agent.start(fn -> nil end)
    asker = self()

    # The first to be asked for {:tell, pid} say so to the test, and never answer.
    task =
      Task.async(fn ->
        Conversation.gather([silent, dying, idle], question({:tell, asker}), 60_000)
      end)

    assert_receive {:told, :talk_leave2, _}
    assert_receive {:told, :talk_leave3, _}
    Process.exit(idle, :kill)
    for {name, :echo} <- [silent, dying], do: kill_for_good(name)
    assert {:partial, answers, missing} = Task.await(task)
    assert answers == %{}
    assert missing == [silent, dying, idle]
    assert {:ok, _} = Conversation.request(quick, question(1))
  end

  test "a late answer, or a second one, reaches no mailbox" do
    peer = service(:talk_late)
    assert {:error, :no_answer} = Conversation.request(peer, question({:tell, self()}), 10)
    assert_receive {:told, :talk_late, asked}
    assert Conversation.post(asked.reply_to, Envelope.reply(asked, :inform, :talk_late, 1)) == :ok
    nothing_left()

    twice =
      spawn(fn ->
        receive do
          %Envelope{} = e ->
            for n <- 1..2,
                do: Conversation.post(e.reply_to, Envelope.reply(e, :inform, :twice, n))
        end
      end)

    assert {:ok, %{content: 1}} = Conversation.request(twice, question(1))
    nothing_left()
  end

  test "an answer that is not an envelope counts as missing" do
    liar =
      spawn(fn ->
        receive do
          %Envelope{} = e ->
            answer = %{Envelope.reply(e, :inform, :liar, 1) | epoch: :junk}
            Conversation.post(e.reply_to, answer)
        end
      end)

    assert Conversation.request(liar, question(1), 60_000) == {:error, :no_answer}
    nothing_left()
  end

  test "a service lives in its robot, and is found by the robot's name" do
    options = [service: :power, module: Answerers.Echo, argument: 12]
    id = robot(:talk_robot, companions: [{Responder, options}])
    assert {:ok, %{from: ^id}} = Conversation.request({id, :power}, question(1))
    assert [_one] = Directory.members({:service, :power})
    kill(id, {:service, :power})
    eventually(fn -> match?({:ok, _}, Conversation.request({id, :power}, question(1), 50)) end)
  end

  test "a service joins a restarted directory by itself" do
    peer = service(:talk_again)
    Process.exit(Process.whereis(Directory), :kill)
    eventually(fn -> match?({:ok, _}, Conversation.request(peer, question(1), 50)) end)
  end

  test "wrong options fail at the start" do
    for options <- [
          [module: Answerers.Echo],
          [service: "x", module: Answerers.Echo],
          [service: :x, module: Answerers.Echo, topics: [1]],
          [service: :x, module: Answerers.Echo, speed: 1],
          [service: :x, module: Answerers.Echo, limit: 0],
          [service: :x, module: Answerers.Echo, topics: [:a | :b]],
          [service: :x, module: Answerers],
          [service: :x, module: "Echo"],
          :junk
        ],
        do: assert_raise(ArgumentError, fn -> Responder.start_link(:talk_bad, options) end)
  end

  test "a wrong question raises with an error that says what is wrong" do
    alias Agents.Topic

    for {module, function, arguments} <- [
          {Conversation, :request, [{:a, :b}, question(1), -1]},
          {Conversation, :request, [{:a, :b}, question(1), :infinity]},
          {Conversation, :gather, [[], question(1), 1.0e308]},
          {Conversation, :gather, [:a, question(1), 1]},
          {Conversation, :gather, [[:a | :b], question(1), 1]},
          {Conversation, :gather, [[], question(1), 1, :half]},
          {Conversation, :gather, [[], question(1), 1, -1]},
          {Topic, :next, [self(), 5_000_000_000]}
        ] do
      assert %ArgumentError{message: line} = catch_error(apply(module, function, arguments))
      refute line =~ "\n"
    end
  end

  # start_supervised starts it again under the same name: then it is another process.
  defp kill_for_good(name) do
    pid = Names.whereis(name, {:service, :echo})
    Process.exit(pid, :kill)
  end
end
