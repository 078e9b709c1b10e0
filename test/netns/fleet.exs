defmodule Netns.Fleet do
  @moduledoc """
  Robots on nodes of their own, each in a network namespace of its own, in one world that no cut touches
  (`Lab.Node.Fleet`). A process that holds what the test knows of them: what their logs say.
  """
  use Agent
  alias Netns.{Events, Story}
  alias Lab.Node.{Fleet, Log}
  alias Vm.Net

  # How often the logs are read while something is awaited: they are written ten times a second.
  @look_ms 50

  @doc """
  Makes the network and the robots, from `{name, pose}`; `folder` is for their logs, `shipped` are the
  modules that run there besides the project's, as `{module, code}`. Options: `guests`, who
  are in the network only, and `carrier`, a function from a robot's name to those arguments of its Erlang that choose
  the distribution's carrier (TCP).
  """
  def start_link({poses, folder, shipped, options}) do
    options = Map.new(Keyword.validate!(options, [:carrier, guests: []]))
    robots = Keyword.keys(poses)

    nodes =
      options
      |> Map.take([:carrier])
      |> Map.merge(%{
        starts: poses,
        place: Net.create(robots, folder, options.guests),
        folder: folder,
        mission: {Netns.Watched, []},
        world: [noise: :off],
        beside: &[{Log, {folder, &1, Events.looks(&1, robots), Events.begin(&1)}}],
        prepare: &ship(&1, shipped)
      })
      |> Fleet.new()
      |> Fleet.start()

    Vm.Fleet.await(nodes.nodes)
    parts = {Log.now(), :net, :parts, [robots]}
    Agent.start_link(fn -> %{fleet: nodes, offsets: %{}, lines: [parts]} end)
  end

  @doc "Loads modules, as `{module, code}`, into a VM."
  def ship(vm, shipped) do
    for {module, code} <- shipped,
        do: {:module, _} = Vm.call(vm, :code, :load_binary, [module, ~c"test", code])
  end

  defp fleet(fleet), do: Agent.get(fleet, & &1.fleet)

  @doc "The network."
  def net(fleet), do: fleet(fleet).network.place

  @doc "The robots' names."
  def robots(fleet), do: fleet(fleet).robots

  @doc "Calls a function on a robot's node."
  def call(fleet, robot, m, f, a, timeout \\ 10_000),
    do: Vm.Fleet.call(fleet(fleet).nodes, robot, m, f, a, timeout)

  @doc "A robot's node."
  def node(fleet, robot), do: Vm.Fleet.vm(fleet(fleet).nodes, robot)

  @doc "Ends a robot's node, as `kill -9` does. Says when."
  def kill(fleet, robot) do
    us = Log.now()
    Vm.Fleet.kill(fleet(fleet).nodes, robot)
    note(fleet, us, :killed, robot)
    us
  end

  @doc "Switches a killed robot on again, where its body stands."
  def revive(fleet, robot) do
    nodes = fleet(fleet).nodes
    :ok = Vm.Fleet.revive(nodes, robot)
    Vm.Fleet.await(nodes, [robot])
  end

  @doc "Changes the network; `parts` is who reaches whom from then on. Says when it began."
  def cut(fleet, parts, change) do
    us = Log.now()
    note(fleet, us, :parts, parts)
    :ok = change.(net(fleet))
    us
  end

  @doc "Makes the network whole, which it is when this returns. Says when that is."
  def heal(fleet) do
    :ok = Net.heal(net(fleet))
    us = Log.now()
    note(fleet, us, :parts, [robots(fleet)])
    us
  end

  @doc "All that the logs say so far, by time."
  def lines(fleet), do: Agent.get_and_update(fleet, &read/1, 30_000)

  @doc "Waits until the logs tell it, and returns what they tell; fails after so many ms with what they told."
  def await(fleet, what, ms, tells),
    do: await_until(fleet, what, System.monotonic_time(:millisecond) + ms, tells)

  defp await_until(fleet, what, deadline, tells) do
    lines = lines(fleet)

    cond do
      told = tells.(lines) ->
        told

      System.monotonic_time(:millisecond) > deadline ->
        now = inspect(Story.now(lines), pretty: true)
        troubles = Enum.join(Story.troubles(lines), "\n")
        raise "the logs do not tell that #{what}; they end so: #{now}\nTroubles:\n#{troubles}"

      true ->
        receive do
        after
          @look_ms -> await_until(fleet, what, deadline, tells)
        end
    end
  end

  defp note(fleet, us, kind, value),
    do: Agent.update(fleet, &%{&1 | lines: [{us, :net, kind, value} | &1.lines]})

  # The world tells where the bodies of all robots are.
  defp read(s) do
    {news, offsets} = Log.read(s.fleet.folder, [:world | s.fleet.robots], s.offsets)

    news =
      for {us, who, kind, value} <- news do
        with {:body, robot} <- kind,
             do: {us, robot, :body, value},
             else: (_ -> {us, who, kind, value})
      end

    lines = Enum.sort_by(news ++ s.lines, &elem(&1, 0))
    {lines, %{s | lines: lines, offsets: offsets}}
  end
end
