defmodule Netns.Fleet do
  @moduledoc """
  Robots on nodes of their own, each in a network namespace of its own. They are controlled over standard
  input and output, which no cut of the network touches. A process that holds what the test knows of
  them: their nodes, and what their logs say.
  """
  use Agent
  alias Netns.{Log, Net, Story}
  alias Mesh.Secret
  alias Mesh.Distribution.Epmd

  @flags ~w(-kernel prevent_overlapping_partitions false -kernel connect_all false
            -kernel dist_auto_connect never -start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd
            -kernel logger_level none
            +S 1:1 +SDio 1 +sbwt none +sbwtdcpu none +sbwtdio none)
  # How often the logs are read while something is awaited.
  @look_ms 200
  @boot_ms 30_000

  @doc """
  Makes the network and the robots, from `{name, pose}`; `folder` is for their logs, `shipped` are the
  modules that run there besides the project's, as `{module, code}`.
  """
  def start_link({poses, folder, shipped}) do
    net = Net.create(Keyword.keys(poses), folder)
    parts = {Log.now(), :net, :parts, [net.robots]}
    s = %{net: net, folder: folder, shipped: shipped, nodes: %{}, offsets: %{}, lines: [parts]}
    {:ok, fleet} = Agent.start_link(fn -> s end)

    poses
    |> Task.async_stream(&switch_on(s, &1, poses), timeout: @boot_ms)
    |> Enum.each(fn {:ok, {robot, node}} -> keep(fleet, robot, node) end)

    {:ok, fleet}
  end

  @doc "The network."
  def net(fleet), do: Agent.get(fleet, & &1.net)

  @doc "The robots' names."
  def robots(fleet), do: net(fleet).robots

  @doc "Calls a function on a robot's node."
  def call(fleet, robot, m, f, a, timeout \\ 10_000) do
    %{peer: peer} = Agent.get(fleet, & &1.nodes[robot])
    :peer.call(peer, m, f, a, timeout)
  end

  @doc "Ends a robot's node, as `kill -9` does. Says when."
  def kill(fleet, robot) do
    %{pid: pid} = Agent.get(fleet, & &1.nodes[robot])
    us = Log.now()
    {_text, 0} = System.cmd("kill", ["-KILL", pid])
    note(fleet, us, :killed, robot)
    us
  end

  @doc "Switches a killed robot on again, where its body stands."
  def revive(fleet, robot) do
    bodies = Story.now(lines(fleet)).bodies

    poses =
      for id <- robots(fleet), {x, y, heading} = bodies[id], do: {id, Hal.Pose.new(x, y, heading)}

    {^robot, node} = switch_on(Agent.get(fleet, & &1), {robot, poses[robot]}, poses)
    keep(fleet, robot, node)
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
        raise "the logs do not tell that #{what}; they end so: #{now}"

      true ->
        receive do
        after
          @look_ms -> await_until(fleet, what, deadline, tells)
        end
    end
  end

  defp note(fleet, us, kind, value),
    do: Agent.update(fleet, &%{&1 | lines: [{us, :net, kind, value} | &1.lines]})

  defp keep(fleet, robot, node), do: Agent.update(fleet, &put_in(&1.nodes[robot], node))

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

  defp switch_on(s, {robot, _pose}, poses) do
    address = Net.address(s.net, robot)
    ip = "{#{address |> Tuple.to_list() |> Enum.join(",")}}"
    own = ["-setcookie", s.net.prefix, "-kernel", "inet_dist_use_interface", ip]
    program = ["netns", "exec", Net.space(s.net, robot), System.find_executable("erl")]

    {:ok, peer, node} =
      :peer.start(%{
        name: robot,
        host: ~c"convoy",
        longnames: false,
        connection: :standard_io,
        exec: {~c"#{System.find_executable("ip")}", Enum.map(program, &to_charlist/1)},
        args:
          Enum.map(@flags ++ own, &to_charlist/1) ++
            Enum.flat_map(:code.get_path(), &[~c"-pa", &1]),
        wait_boot: @boot_ms
      })

    call = &:peer.call(peer, &1, &2, &3, @boot_ms)
    {:ok, _} = call.(Application, :ensure_all_started, [:logger])
    :ok = call.(Logger, :configure, [[level: :none]])

    for {module, code} <- s.shipped,
        do: {:module, _} = call.(:code, :load_binary, [module, ~c"test", code])

    missions = Application.fetch_env!(:swarm, :missions)
    :ok = call.(Application, :put_env, [:swarm, :missions, missions])
    :ok = call.(Application, :put_env, [:swarm, :mesh, mesh(s.net, robot, address)])
    # Together, so that the missions are there when the mesh begins: it must know their atoms.
    {:ok, _} = call.(Application, :ensure_all_started, [:sim])
    :ok = call.(Netns.Robot, :start, [robot, poses, s.folder])
    {robot, %{peer: peer, node: node, pid: "#{call.(:os, :getpid, [])}"}}
  end

  defp mesh(net, robot, address) do
    secret = %Secret{
      path: "",
      key: :crypto.hash(:sha256, net.prefix),
      cookie: String.to_atom(net.prefix),
      fingerprint: ""
    }

    port = Epmd.default_port(Atom.to_string(robot))
    [secret: secret, fleet: net.robots, interface: address, dist_port: port]
  end
end
