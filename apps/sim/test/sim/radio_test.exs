defmodule Sim.RadioTest do
  use ExUnit.Case, async: true
  alias Sim.Radio

  defp run(options, count) do
    radio = Radio.new(options)

    radio =
      Enum.reduce(1..count, radio, fn k, radio -> Radio.send(radio, k, :mag1, [:mag2], k) end)

    {got, radio} = Radio.receive(radio, count + 1_000)
    {Enum.map(got, &elem(&1, 2)), radio}
  end

  test "loses the given share, and counts it" do
    {got, radio} = run([seed: 3, loss: 0.2], 5_000)
    assert radio.sent == 5_000
    assert length(got) == 5_000 - radio.lost
    assert_in_delta radio.lost, 1_000, 100
  end

  test "delays by 5 to 50 ms, so messages overtake each other, and delivers in the order of time" do
    {got, _} = run([seed: 3], 1_000)
    assert Enum.sort(got) == Enum.to_list(1..1_000)
    refute got == Enum.sort(got)

    radio = Radio.send(Radio.new(seed: 3), 100, :mag1, [:mag2], :hello)
    assert {[], radio} = Radio.receive(radio, 104)
    assert {[{:mag2, :mag1, :hello}], radio} = Radio.receive(radio, 150)
    assert {[], _} = Radio.receive(radio, 1_000)
  end

  test "duplicates, and a cut that heals" do
    {got, _} = run([seed: 3, duplicates: 1.0], 10)
    assert Enum.sort(got) == Enum.sort(Enum.to_list(1..10) ++ Enum.to_list(1..10))
    radio = Radio.new(seed: 1, cut: [{:mag2, :mag1}])
    radio = Radio.send(radio, 0, :mag1, [:mag2], :a)
    radio = radio |> Radio.cut([]) |> Radio.send(0, :mag1, [:mag2], :b)
    assert {[{:mag2, :mag1, :b}], %{sent: 2, lost: 1}} = Radio.receive(radio, 50)
  end

  test "one direction of a link, and the parts that cuts make" do
    radio = Radio.cut_ways(Radio.new(seed: 1), mag1: :mag2)
    radio = radio |> Radio.send(0, :mag1, [:mag2], :a) |> Radio.send(0, :mag2, [:mag1], :b)
    assert {[{:mag1, :mag2, :b}], _} = Radio.receive(radio, 50)
    # By way of the third they can still reach each other in both directions.
    assert Radio.parts(radio, [:mag1, :mag2, :mag3]) == [[:mag1, :mag2, :mag3]]
    assert Radio.parts(radio, [:mag1, :mag2]) == [[:mag1], [:mag2]]
    assert Radio.parts(radio, []) == []
  end

  test "one seed gives one course" do
    assert run([seed: 9, loss: 0.3], 100) == run([seed: 9, loss: 0.3], 100)
    refute run([seed: 9, loss: 0.3], 100) == run([seed: 8, loss: 0.3], 100)
  end
end
