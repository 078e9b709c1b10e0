defmodule Mesh.Air do
  @moduledoc """
  Stations of several nodes without sockets: datagrams take 1 ms, unless they are lost or the
  link is cut; ticks come every 200 ms. Each station has a clock of its own, which began at another
  time. Pure but for `:rand`, which ExUnit seeds.
  """
  alias Mesh.{Secret, Strategy}
  alias Mesh.Protocol.Roster

  @group {{239, 255, 67, 86}, 4371}

  defstruct now: 0,
            clocks: %{},
            stations: %{},
            addresses: %{},
            air: [],
            cut: [],
            loss: 0.0,
            out: [],
            tap: []

  def secret(key \\ "k") do
    %Secret{path: "", key: String.duplicate(key, 32), cookie: :none, fingerprint: ""}
  end

  def new(options \\ []), do: struct!(__MODULE__, options)

  @doc """
  Switches a node on; `multicast: false` and `peers: [names]` for a network without multicast, `rate: 1.01` for a clock
  that is fast by 1 %.
  """
  def join(air, name, options \\ []) do
    number = Enum.count(air.addresses) + 1
    address = Map.get(air.addresses, name, {{10, 0, 0, number}, 4370})
    air = %{air | addresses: Map.put(air.addresses, name, address)}
    group = if Keyword.get(options, :multicast, true), do: @group
    gossip = for group <- List.wrap(group), do: begin(Strategy.Gossip, group)

    static =
      for peers <- List.wrap(options[:peers] && [options[:peers]]),
          do: begin(Strategy.Static, Enum.map(peers, &air.addresses[&1]))

    protocol =
      Mesh.Protocol.new(
        secret: options[:secret] || secret(),
        roster: Roster.new(:"#{name}@lab", options[:fleet] || [:a, :b, :c, :d, :e, :f]),
        session: options[:session] || :rand.uniform(1_000_000_000),
        strategies: gossip ++ static,
        port: 0,
        addresses: [address],
        group: group,
        consumer: Mesh.FakeConsumer,
        services: [:rows, :stop],
        late: [:stop]
      )

    clock = {:rand.uniform(2_000_000_000) - 1_000_000_000, options[:rate] || 1.0}
    put_in(air.stations[name], protocol) |> Map.update!(:clocks, &Map.put(&1, name, clock))
  end

  @doc "A station's own time."
  def time(air, name) do
    {start_ms, rate} = air.clocks[name]
    start_ms + trunc(air.now * rate)
  end

  @doc "A station's clock stood still for so long, as in a suspended computer."
  def suspend(air, name, ms) do
    update_in(air.clocks[name], fn {start_ms, rate} -> {start_ms - ms, rate} end)
  end

  defp begin(module, options) do
    {:ok, state} = module.init(options)
    {module, state}
  end

  def leave(air, name), do: %{air | stations: Map.delete(air.stations, name)}

  @doc "Lets time go by."
  def run(air, 0), do: air
  def run(air, ms), do: air |> step() |> run(ms - 1)

  defp step(air) do
    air = %{air | now: air.now + 1}
    {due, later} = Enum.split_with(air.air, fn {at, _, _, _} -> at <= air.now end)
    air = Enum.reduce(Enum.reverse(due), %{air | air: later}, &arrive/2)

    if rem(air.now, 200) == 0,
      do: Enum.reduce(Enum.sort(Map.keys(air.stations)), air, &tick/2),
      else: air
  end

  defp tick(name, air) do
    act(air, name, Mesh.Protocol.tick(air.stations[name], [], time(air, name), :rand.uniform()))
  end

  def speak(air, name, to, message),
    do: act(air, name, Mesh.Protocol.speak(air.stations[name], to, message, time(air, name)))

  @doc "A datagram from outside."
  def inject(air, name, datagram, address \\ {{10, 9, 9, 9}, 1}),
    do: act(air, name, Mesh.Protocol.hear(air.stations[name], datagram, address, time(air, name)))

  defp arrive({_at, from, to, datagram}, air) do
    case air.stations do
      %{^to => protocol} ->
        act(air, to, Mesh.Protocol.hear(protocol, datagram, air.addresses[from], time(air, to)))

      _off ->
        air
    end
  end

  defp act(air, name, {protocol, effects}) do
    Enum.reduce(effects, put_in(air.stations[name], protocol), &effect(&1, name, &2))
  end

  defp effect({:send, @group, datagram}, name, air) do
    for {other, %{group: group}} <- air.stations, group != nil, reduce: air do
      air -> put(air, name, other, datagram)
    end
  end

  defp effect({:send, address, datagram}, name, air) do
    case Enum.find(air.addresses, fn {_name, there} -> there == address end) do
      {other, _address} -> put(air, name, other, datagram)
      nil -> air
    end
  end

  defp effect(effect, name, air), do: %{air | out: [{air.now, name, effect} | air.out]}

  defp put(air, from, to, datagram) do
    air = %{air | tap: [datagram | air.tap]}
    lost? = :rand.uniform() < air.loss or {from, to} in air.cut
    if lost?, do: air, else: %{air | air: [{air.now + 1, from, to, datagram} | air.air]}
  end
end
