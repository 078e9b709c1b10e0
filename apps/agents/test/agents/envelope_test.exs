defmodule Agents.EnvelopeTest do
  use ExUnit.Case, async: true
  doctest Agents.Envelope
  alias Agents.Envelope

  defp good, do: Envelope.new(:request, :mag1, %{any: "thing"}, conversation: {:mag1, 1})

  test "valid envelopes pass" do
    for change <- [
          %{conversation: {:mag1, 7}},
          %{reply_to: self(), in_reply_to: make_ref()},
          %{reply_to: make_ref(), in_reply_to: self()},
          %{epoch: 0},
          %{epoch: 500_000_000},
          %{epoch: 18_446_744_073_709_551_615},
          %{topic: :poses},
          %{topic: "poses of all"},
          %{class: :urgent},
          %{content: fn -> :whatever end}
        ] do
      envelope = Map.merge(good(), change)
      assert Envelope.check(envelope) == {:ok, envelope}
    end

    for performative <- Envelope.performatives(),
        do: assert({:ok, _} = Envelope.check(%{good() | performative: performative}))
  end

  test "an invalid field is named" do
    for {field, bad} <- [
          performative: [nil, :shout, "inform", 1],
          from: [nil, true, false, "mag1", self()],
          conversation: [nil, 1, {:mag1, -1}, {"mag1", 1}, {:mag1, 1, 1}, {nil, 1}, self()],
          reply_to: [:mag1, "x", {:a, :b}],
          in_reply_to: [:mag1, 5],
          epoch: [-1, 1.0, :one, 18_446_744_073_709_551_616],
          topic: ["", String.duplicate("x", 256), <<255>>, true, false, 5, [:a]],
          class: [nil, :slow, 1]
        ],
        value <- bad do
      assert Envelope.check(Map.replace!(good(), field, value)) == {:error, field}
    end
  end

  test "a term that is not an envelope is an error" do
    for term <- [
          nil,
          [],
          %{},
          %{__struct__: Envelope},
          Map.put(good(), :more, 1),
          Map.delete(good(), :content),
          Map.from_struct(good()),
          %{Map.delete(good(), :content) | from: :mag1} |> Map.put(:other, 1)
        ],
        do: assert(Envelope.check(term) == {:error, :not_an_envelope})
  end

  test "an answer stays in the conversation, however it is built" do
    for options <- [[], [reply_to: self()]] do
      alias = make_ref()

      asked =
        Envelope.new(:cfp, :mag1, 1, reply_to: alias, epoch: 3, class: :telemetry, topic: :t)

      answer = Envelope.reply(asked, :propose, :min1, 2, options)
      assert {:ok, ^answer} = Envelope.check(answer)
      assert answer.conversation == asked.conversation
      assert answer.in_reply_to == alias
      assert answer.reply_to == options[:reply_to]

      assert {answer.epoch, answer.class, answer.topic, answer.from, answer.content} ==
               {3, :telemetry, nil, :min1, 2}
    end
  end

  test "an envelope that nobody would accept is not built" do
    assert_raise ArgumentError, ~r/performative/, fn -> Envelope.new(:shout, :mag1, 1) end
    assert_raise ArgumentError, ~r/from/, fn -> Envelope.new(:inform, nil, 1) end
    assert_raise ArgumentError, ~r/from/, fn -> Envelope.reply(good(), :inform, nil, 1) end
    assert_raise ArgumentError, ~r/epoch/, fn -> Envelope.new(:inform, :mag1, 1, epoch: -1) end

    # By apply/3, because compilers that infer types see the mistake themselves.
    assert_raise ArgumentError, ~r/options/, fn ->
      apply(Envelope, :new, [:inform, :mag1, 1, :urgent])
    end

    assert_raise ArgumentError, ~r/options/, fn ->
      Agents.Topic.publish(:poses, :mag1, 1, :urgent)
    end

    assert_raise ArgumentError, ~r/:speed/, fn -> Envelope.new(:inform, :mag1, 1, speed: 1) end
  end

  # Random damage to good envelopes never causes a crash, and what passes is valid.
  test "damaged envelopes never crash the check" do
    junk = [nil, true, 0, -1, 1.5, "text", <<0xFF>>, :atom, {}, [], [1 | 2], %{}, self()]
    keys = Map.keys(good())

    for _ <- 1..2_000 do
      damaged =
        Enum.reduce(1..:rand.uniform(3), good(), fn _, envelope ->
          key = Enum.random(keys)

          case :rand.uniform(3) do
            1 -> Map.delete(envelope, key)
            2 -> Map.put(envelope, Enum.random(junk), Enum.random(junk))
            3 -> Map.put(envelope, key, Enum.random(junk))
          end
        end)

      case Envelope.check(damaged) do
        {:ok, ^damaged} -> assert Map.keys(damaged) == keys
        {:error, reason} -> assert is_atom(reason)
      end
    end
  end
end
