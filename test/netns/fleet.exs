defmodule Netns.Fleet do
  @moduledoc """
  Robots on nodes of their own (`Vm`), each in a network namespace of its own. A process that holds what the test knows of
  them: their nodes, and what their logs say.
  """
  use Agent
  alias Netns.{Log, Story}
  alias Vm.Net
  alias Mesh.Secret
  alias Mesh.Distribution.Epmd

  @flags ~w(-start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd
            -kernel logger_level none)
  @tcp ~w(-proto_dist Elixir.Mesh.Distribution.Tcp)
  # How often the logs are read while something is awaited.
  @look_ms 200
  @boot_ms 30_000

  @doc """
  Makes the network and the robots, from `{name, pose}`; `folder` is for their logs, `shipped` are the
  modules that run there besides the project's, as `{module, code}`. Options: `guests`, who
  are in the network only, and `carrier`, a function from a robot's name to those arguments of its Erlang that choose
  the distribution's carrier (TCP).
  """
  def start_link({poses, folder, shipped, options}) do
    options = Keyword.validate!(options, guests: [], carrier: fn _robot -> @tcp end)
    net = Net.create(Keyword.keys(poses), folder, options[:guests])
    parts = {Log.now(), :net, :parts, [net.robots]}

    s = %{
      net: net,
      folder: folder,
      shipped: shipped,
      carrier: options[:carrier],
      nodes: %{},
      offsets: %{},
      lines: [parts]
    }

    {:ok, fleet} = Agent.start_link(fn -> s end)

    switch_on(fleet, net.robots, poses)
    {:ok, fleet}
  end

  @doc "The network."
  def net(fleet), do: Agent.get(fleet, & &1.net)

  @doc "The robots' names."
  def robots(fleet), do: net(fleet).robots

  @doc "Calls a function on a robot's node."
  def call(fleet, robot, m, f, a, timeout \\ 10_000) do
    Vm.call(node(fleet, robot), m, f, a, timeout)
  end

  @doc "A robot's node."
  def node(fleet, robot), do: Agent.get(fleet, & &1.nodes[robot])

  @doc "Ends a robot's node, as `kill -9` does. Says when."
  def kill(fleet, robot) do
    node = node(fleet, robot)
    us = Log.now()
    Vm.signal(node, "KILL")
    note(fleet, us, :killed, robot)
    us
  end

  @doc "Switches a killed robot on again, where its body stands."
  def revive(fleet, robot) do
    bodies = Story.now(lines(fleet)).bodies

    poses =
      for id <- robots(fleet), {x, y, heading} = bodies[id], do: {id, Hal.Pose.new(x, y, heading)}

    switch_on(fleet, [robot], poses)
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

  defp read(s) do
    {news, offsets} =
      Enum.flat_map_reduce(s.net.robots, s.offsets, fn robot, offsets ->
        {lines, size} = read(Path.join(s.folder, "#{robot}.log"), Map.get(offsets, robot, 0))
        {lines, Map.put(offsets, robot, size)}
      end)

    lines = Enum.sort_by(news ++ s.lines, &elem(&1, 0))
    {lines, %{s | lines: lines, offsets: offsets}}
  end

  # Only what is new in the file, and of that only whole lines.
  defp read(path, offset) do
    {:ok, file} = :file.open(path, [:read, :raw, :binary])
    text = with :eof <- pread(file, offset), do: ""
    :ok = :file.close(file)
    whole = text |> String.split("\n") |> Enum.drop(-1)
    size = whole |> Enum.map(&(byte_size(&1) + 1)) |> Enum.sum()
    {Enum.map(whole, &parse/1), offset + size}
  end

  defp pread(file, offset),
    do: with({:ok, text} <- :file.pread(file, offset, 10_000_000), do: text)

  defp parse(line) do
    {:ok, tokens, _end} = line |> String.to_charlist() |> :erl_scan.string()
    {:ok, term} = :erl_parse.parse_term(tokens)
    term
  end

  defp switch_on(fleet, robots, poses) do
    s = Agent.get(fleet, & &1)
    nodes = Vm.start(for robot <- robots, do: options(s, robot))

    robots
    |> Enum.zip(nodes)
    |> Enum.map(fn {robot, node} -> Task.async(fn -> start_robot(s, robot, node, poses) end) end)
    |> Task.await_many(@boot_ms)

    Agent.update(fleet, &%{&1 | nodes: Enum.into(Enum.zip(robots, nodes), &1.nodes)})
  end

  defp options(%{net: net, carrier: carrier}, robot) do
    # On all addresses, for they may change.
    flags = Vm.fleet_flags({0, 0, 0, 0}) ++ @flags ++ carrier.(robot)
    flags = flags ++ ["-setcookie", net.prefix]
    through = ["ip", "netns", "exec", Net.space(net, robot)]
    [name: robot, host: "convoy", flags: flags, through: through]
  end

  defp start_robot(s, robot, node, poses) do
    for {module, code} <- s.shipped,
        do: {:module, _} = Vm.call(node, :code, :load_binary, [module, ~c"test", code])

    missions = Application.fetch_env!(:swarm, :missions)
    mesh = mesh(s.net, robot)
    # Together, so that the missions are there when the mesh begins: it must know their atoms.
    config = [logger: [level: :none], swarm: [missions: missions, mesh: mesh]]
    :ok = Vm.start_apps(node, [:lab], config)
    :ok = Vm.call(node, Netns.Robot, :start, [robot, poses, s.folder], @boot_ms)
  end

  defp mesh(net, robot) do
    secret = %Secret{
      path: "",
      key: :crypto.hash(:sha256, net.prefix),
      cookie: String.to_atom(net.prefix),
      fingerprint: ""
    }

    port = Epmd.default_port(Atom.to_string(robot))
    [secret: secret, fleet: net.robots, dist_port: port]
  end
end
