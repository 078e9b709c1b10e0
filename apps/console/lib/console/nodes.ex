defmodule Console.Nodes do
  @moduledoc """
  Tells which nodes a fleet has, which robots are there, and which programs run on these (`Agents.Programs`); starts and ends programs. What it tells
  is seen from this node.
  """
  alias Agents.{Conversation, Envelope}
  alias Swarm.Commands.Client
  alias Swarm.Directory

  @answer_ms 500
  # More is not shown of one robot.
  @most 100

  @typedoc """
  `runs` of a program; `ours` of one that people start and end here, which those of a robot's file are not. `why` in place of the programs of a
  robot that does not tell them.
  """
  @type row :: %{
          node: String.t(),
          state: String.t(),
          robots: [
            %{
              id: atom(),
              why: String.t() | nil,
              programs: [%{name: String.t(), runs: boolean(), ours: boolean()}]
            }
          ]
        }

  @doc "The nodes, in the order of their names, and on each those of these robots that are there. It waits half a second at most for robots that do not answer."
  @spec look([atom()]) :: [row()]
  def look(robots) do
    view = if Mesh.running?(), do: Mesh.view().nodes, else: %{}
    placed = for robot <- robots, node = place(robot, view), do: {node, robot}
    services = Map.new(Directory.services())
    told = programs(for {_node, robot} <- placed, do: robot)
    there = Enum.group_by(placed, &elem(&1, 0), &elem(&1, 1))

    for node <- Enum.sort(Enum.uniq([node() | Map.keys(view) ++ Map.keys(there)])) do
      robots = for id <- there[node] || [], do: robot(id, told[id], services[id] || [])
      %{node: Atom.to_string(node), state: state(node, view[node]), robots: robots}
    end
  end

  # Where its comms are; a robot that is only heard has none here.
  defp place(robot, view) do
    case Directory.whereis(robot) do
      nil -> Enum.find_value(view, fn {node, %{robots: robots}} -> robot in robots && node end)
      pid -> node(pid)
    end
  end

  defp state(node, _seen) when node == node(), do: "this node"
  defp state(_node, nil), do: "connected"

  defp state(_node, %{status: status, connected: connected?, age_ms: age_ms}) do
    "#{status}, heard #{:erlang.float_to_binary(age_ms / 1_000, decimals: 1)} s ago" <>
      if(connected?, do: "", else: ", not connected")
  end

  defp programs(robots) do
    question = Envelope.new(:query, :console, :programs)
    peers = for robot <- robots, do: {robot, :programs}
    {_whole?, answers, _missing} = Conversation.gather(peers, question, @answer_ms)

    for {{robot, :programs}, %{performative: :inform, content: told}} <- answers,
        into: %{},
        do: {robot, checked(told)}
  end

  # From another node.
  defp checked(told) when is_list(told) do
    if List.improper?(told),
      do: [],
      else:
        for(
          {name, runs?} <- Enum.take(told, @most),
          name?(name) and is_boolean(runs?),
          do: {name, runs?}
        )
  end

  defp checked(_malformed), do: []

  defp name?(name),
    do: is_binary(name) and byte_size(name) in 1..255 and String.printable?(name)

  defp robot(id, nil, services) do
    why = if :programs in services, do: "does not answer", else: "takes no programs from here"
    %{id: id, why: why, programs: own(services, [])}
  end

  defp robot(id, told, services) do
    ours = for {name, runs?} <- told, do: %{name: name, runs: runs?, ours: true}
    %{id: id, why: nil, programs: ours ++ own(services, told)}
  end

  # Those of its file.
  defp own(services, told) do
    for service <- services,
        service != :programs,
        name = Atom.to_string(service),
        not List.keymember?(told, name, 0),
        do: %{name: name, runs: true, ours: false}
  end

  @doc """
  The same in lines, for a terminal.

      iex> mag1 = %{id: :mag1, why: nil, programs: [%{name: "battery", runs: false, ours: true}]}
      iex> Console.Nodes.lines([%{node: "one@desk", state: "this node", robots: [mag1]}, %{node: "two@desk", state: "connected", robots: []}])
      ["one@desk: this node", "  mag1: battery (ended)", "two@desk: connected"]
  """
  @spec lines([row()]) :: [String.t()]
  def lines(rows) do
    for %{node: node, state: state, robots: robots} <- rows,
        line <- ["#{node}: #{state}" | Enum.map(robots, &line/1)],
        do: line
  end

  defp line(%{id: id, why: why, programs: programs}) do
    words =
      for %{name: name, runs: runs?} <- programs, do: if(runs?, do: name, else: "#{name} (ended)")

    "  #{id}: #{Enum.join(List.wrap(why) ++ words, ", ")}"
  end

  @doc """
  Starts or ends a program on a robot. `:ok` says that the robot has told that it runs, or that it has ended; the error says in one line why not, or that it is
  not known. `Swarm.by/2` names the giver.
  """
  @spec order(robot :: atom(), :start | :end, program :: String.t()) ::
          {:ok, String.t()} | {:error, line :: String.t()}
  def order(robot, what, program) when what in [:start, :end] do
    request = Envelope.new(:request, :console, {what, program, Client.giver()})

    case Conversation.request({robot, :programs}, request, @answer_ms) do
      {:ok, %{performative: :inform, content: ^program}} ->
        {:ok, "#{program} #{if what == :start, do: "runs", else: "has ended"} on #{robot}"}

      {:ok, %{performative: :refuse, content: line}} ->
        {:error, if(name?(line), do: line, else: "#{robot} refuses it, and does not say why")}

      {:ok, _failure} ->
        {:error, "#{robot} failed at it: whether #{program} runs there is not known"}

      {:error, :unknown} ->
        {:error, "#{robot} takes no programs from here: it is not heard, or its build has none"}

      {:error, reason} when reason in [:not_connected, :busy] ->
        {:error, "not sent: the node of #{robot} is not connected"}

      {:error, _gone_or_silent} ->
        {:error, "#{robot} has not answered: whether #{program} runs there is not known"}
    end
  end
end
