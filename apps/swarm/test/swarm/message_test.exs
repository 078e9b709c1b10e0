defmodule Swarm.MessageTest do
  @moduledoc "Whatever comes from outside, the ear survives it."
  use ExUnit.Case, async: true
  alias Swarm.{Anchor, Heartbeat, Message, Round}
  alias Swarm.Link.Ear
  doctest Swarm.Stop
  doctest Swarm.Shape
  doctest Ear
  doctest Swarm.Missions.Manual

  @beat %Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
  @anchor %Anchor{
    leader: :mag1,
    epoch: 1,
    sequence: 1,
    pose: {0, 0, 0},
    twist: {0, 0},
    formation: {:column, 1.0},
    order: [:mag2],
    size: 2,
    places: [1]
  }
  @letter %Round.Letter{id: {1, 1, :mag1}, view: [:mag1], remaining_ms: 10, purpose: :search}

  defp junk do
    Enum.random([
      nil,
      :atom,
      "text",
      1,
      -1,
      1.5,
      1.0e300,
      999_999_999_999_999,
      [],
      [:a | :b],
      [1],
      [[]],
      {},
      {1},
      {1, 2},
      {1, 2, 3},
      {1.5, nil, :x},
      {:column, :x},
      {:circle, 1},
      %{},
      %{size_ppm: :x, distance: nil},
      %{size_ppm: 1, distance: -1},
      %{:a => 1, 2 => 3},
      %{found: 1, size_ppm: 0, pose: nil},
      %{mag1: %{}},
      self(),
      make_ref(),
      fn -> 1 end,
      %{__struct__: Heartbeat},
      %{__struct__: Anchor},
      %{__struct__: :nothing},
      <<1::3>>,
      @beat,
      @anchor
    ])
  end

  test "no spoilt message raises, or is taken for a good one with a number out of range" do
    for _ <- 1..20_000 do
      {kind, whole} =
        Enum.random(
          heartbeat: @beat,
          heartbeat: %{@beat | anchor: @anchor},
          place: @anchor,
          round: @letter
        )

      key = whole |> Map.keys() |> Enum.random()

      body =
        case Enum.random(1..3) do
          1 ->
            Map.delete(whole, key)

          2 ->
            Map.put(whole, key, junk())

          3 ->
            whole |> Map.put(key, junk()) |> Map.put(whole |> Map.keys() |> Enum.random(), junk())
        end

      message = Message.new(:mag1, kind, body)

      message =
        if :rand.uniform(20) == 1,
          do: Map.put(message, Enum.random([:from, :kind, :body]), junk()),
          else: message

      {heard, ear} = Ear.hear(Ear.new(:mag2), message, 0)

      case heard do
        {:peer, id} -> assert %{mode: _} = Swarm.Peers.percept(ear.peers, id, 0)
        {:message, _message} -> :ok
        :nothing -> assert map_size(ear.rejected) == 1
      end
    end
  end
end
