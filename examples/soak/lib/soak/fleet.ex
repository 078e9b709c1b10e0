defmodule Soak.Fleet do
  @moduledoc """
  Describes the nodes of a run: `Lab.Node.Fleet`, each started again 2 s after its end, as systemd does it
  (`rel/convoy.service`). Where this machine allows it each robot has a network namespace (`Vm.Net`), so that links can
  be cut. The first robot has the real drivers of a Magellan, on emulated devices behind serial lines, so that there are port
  programs to be left behind.
  """
  alias Lab.Node.{Fleet, Log}
  alias Sim.World.Snapshot
  alias Soak.Recorder
  alias Vm.Net

  @restart_ms 2_000

  @doc "Makes folder and network; nothing runs yet."
  @spec create([atom()], integer(), boolean(), String.t()) :: Fleet.t()
  def create(robots, seed, namespaces?, mark) do
    folder = Path.join(System.tmp_dir!(), "convoy-soak-#{mark}")
    File.mkdir_p!(folder)
    File.chmod!(folder, 0o700)
    place = if namespaces?, do: Net.create(robots, folder, [:stranger]), else: :loopback
    [{_name, mission} | _] = Application.fetch_env!(:swarm, :missions)

    Fleet.new(%{
      starts: Fleet.abreast(robots),
      place: place,
      folder: folder,
      mission: {mission, []},
      world: [seed: seed],
      hardware: [hd(robots)],
      beside: fn name ->
        if name == :world, do: [], else: [{Log, {folder, name, Recorder.looks(name), nil}}]
      end,
      nodes: [tell: self(), again_ms: @restart_ms, mark: mark]
    })
  end

  @doc "How many collisions there had been by then, and the newest of them in words, newest first."
  @spec collisions(Snapshot.t(), Sim.World.t()) :: {non_neg_integer(), [String.t()]}
  def collisions(snapshot, begun) do
    world = Snapshot.onto(begun, snapshot)
    {world.collisions, Enum.map(world.contacts, &contact/1)}
  end

  defp contact({at_ms, parties, with_what}) do
    wall = if with_what == :wall, do: " and a wall", else: ""
    "at #{at_ms} ms of the world " <> Enum.map_join(parties, " and ", &party/1) <> wall
  end

  defp party({id, {x, y}, linear}) do
    [x, y, linear] = for metres <- [x, y, linear], do: Float.round(metres, 2)
    "#{id} at (#{x}, #{y}), told #{linear} m/s"
  end

  @doc "Changes the network as a deed of `Soak.Schedule` says; says who reaches whom no more from then on."
  @spec cut(Net.t(), tuple()) :: [{atom(), atom()}]
  def cut(net, {:block, a, b, _ms}) do
    :ok = Net.block(net, a, b)
    [{a, b}]
  end

  def cut(net, {:split, [one, other] = parts, _ms}) do
    :ok = Net.split(net, parts)
    for a <- one, b <- other, do: {a, b}
  end

  def cut(net, {:loss, share, _ms}) do
    :ok = Net.lose(net, share)
    []
  end

  @doc "Takes network and folder away."
  @spec delete(Fleet.t()) :: :ok
  def delete(%{network: %{place: place}, folder: folder}) do
    if place != :loopback, do: :ok = Net.delete(place)
    _gone = File.rm_rf(folder)
    :ok
  end

  @doc "Keeps the logs of a run beside its journal, in a folder of the same name without `.log`; returns it."
  @spec keep(Fleet.t(), journal :: Path.t()) :: Path.t()
  def keep(%{folder: folder}, journal) do
    kept = Path.rootname(journal)
    File.mkdir_p!(kept)

    for path <- Path.wildcard(Path.join(folder, "*.log")),
        do: File.cp!(path, Path.join(kept, Path.basename(path)))

    kept
  end
end
