defmodule Lab.Recording.Tables do
  @moduledoc """
  Writes a recording as tables for other programs (CSV as in RFC 4180). Pure.

  | table | a row |
  |---|---|
  | `poses` | each robot each 100 ms: where it is, in metres and radians, and its phase |
  | `errors` | each robot with a place in a formation: how far from it, and how sure of its pose it says it is |
  | `ticks` | each 100 ms: the leader, and the formation's error |
  | `messages` | each message: its sender and its receiver |
  | `events` | what happened to the fleet |

  Of robots of processes `poses` are those that they believe, `alive` says whether something was recorded of the robot in
  the second before, and `messages` has those of the missions, without heartbeats. Their places in the formation
  and its error are unknown: these columns are empty.
  """
  alias Lab.Recording.Facts
  alias Sim.Scene

  @headers [
    poses: "at_s,robot,alive,phase,x_m,y_m,heading_rad,speed_m_s,turn_rad_s",
    errors: "at_s,robot,place_x_m,place_y_m,error_m,within_m",
    ticks: "at_s,leader,epoch,formed,error_mean_m,error_max_m",
    messages: "at_s,from,to,kind",
    events: "at_s,event,robot,facts"
  ]

  @type table :: :poses | :errors | :ticks | :messages | :events

  @doc """
  The tables with their first lines.

      iex> Lab.Recording.Tables.headers()[:messages] |> IO.iodata_to_binary()
      "at_s,from,to,kind\\r\\n"
  """
  @spec headers() :: [{table(), iodata()}]
  def headers, do: for({table, line} <- @headers, do: {table, [line, "\r\n"]})

  @doc "The rows of a tick; of the scene's stages only those after the first `told`."
  @spec rows(Facts.t(), Scene.t(), told :: non_neg_integer()) :: [{table(), iodata()}]
  def rows(facts, %Scene{} = scene, told) do
    at_s = scene.at_ms / 1000

    [
      poses: for(robot <- scene.robots, do: pose(at_s, robot, facts.speeds[robot.id])),
      errors: for(robot <- scene.robots, robot.slot || believed?(scene), do: error(at_s, robot)),
      ticks: [tick(at_s, scene)],
      messages: for({id, to, kind, _pose} <- facts.sent, do: message(at_s, id, to, kind)),
      events: for(stage <- Enum.drop(scene.stages, told), do: event(stage))
    ]
  end

  defp pose(at_s, robot, speed) do
    %{pose: %{x: x, y: y, heading: heading}} = robot
    {linear, turn} = if speed, do: {speed.linear, speed.turn}, else: {nil, nil}
    row([at_s, robot.id, robot.alive, robot.state, x, y, heading, linear, turn])
  end

  # Of robots of processes neither the truth nor a map is known.
  defp believed?(scene), do: scene.map == nil

  defp error(at_s, robot) do
    {x, y} = robot.slot || {nil, nil}
    row([at_s, robot.id, x, y, Scene.slot_error(robot), robot.uncertainty])
  end

  defp tick(at_s, scene) do
    {mean, most} = scene.error || {nil, nil}
    row([at_s, scene.leader, scene.epoch, scene.formed?, mean, most])
  end

  defp message(at_s, from, to, kind),
    do: row([at_s, from, to |> List.wrap() |> Enum.map_join(" ", &Atom.to_string/1), kind])

  defp event(%{stage: name, at_s: at_s} = stage) do
    facts = stage |> Map.drop([:stage, :at_s, :robot]) |> Enum.sort()

    row([
      at_s,
      name,
      stage[:robot],
      Enum.map_join(facts, " ", fn {k, v} -> "#{k}=#{inspect(v)}" end)
    ])
  end

  defp row(fields), do: [Enum.map_intersperse(fields, ?,, &field/1), "\r\n"]

  defp field(nil), do: ""
  defp field(float) when is_float(float), do: :erlang.float_to_binary(float, [:short])
  defp field(other) when is_atom(other) or is_integer(other), do: to_string(other)

  # Quoted where it must be.
  defp field(text) when is_binary(text) do
    if text =~ ~r/[",\r\n]/, do: [?", String.replace(text, "\"", "\"\""), ?"], else: text
  end
end
