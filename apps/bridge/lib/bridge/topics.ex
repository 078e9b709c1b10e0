defmodule Bridge.Topics do
  @moduledoc """
  Describes what a live fleet says: what a recording of it says of a scene (`Lab.Recording.Topics`), and of each robot two
  topics more. Pure.

  | topic | what | schema |
  |---|---|---|
  | `/map`, `/tf`, `/scene`, `/paths`, `/log`, `/mission`, `/ROBOT/pose`, `/ROBOT/state` | as in a recording | as there |
  | `/ROBOT/why` | what it does and why, in words, 2 Hz | plain JSON |
  | `/ROBOT/scan` | where the beams of its lidar or its sonars end, 5 Hz | `foxglove.SceneUpdate` |

  Poses are those that the fleet's page shows: of a simulated fleet the true ones, of real robots what they believe. Robots
  whose pose is in another frame than that of most are not drawn.
  """
  @behaviour Bridge.Catalogue
  alias Bridge.Catalogue
  alias Lab.Recording.{Facts, Topics}
  alias Mcap.Foxglove
  alias Record.Recording.Drawing, as: Shapes

  @of_robots [why: {500, nil}, scan: {200, "foxglove.SceneUpdate"}]

  @impl Bridge.Catalogue
  def list(robots) do
    for({{key, name, schema}, ms} <- Topics.live(robots), do: topic(key, name, schema, ms)) ++
      for robot <- robots, {what, {ms, schema}} <- @of_robots do
        topic({robot, what}, "/#{robot}/#{what}", schema && Foxglove.schema(schema), ms)
      end
  end

  defp topic(key, name, schema, ms),
    do: %{key: key, name: name, schema: schema, pace: if(ms == 0, do: :events, else: ms)}

  @impl Bridge.Catalogue
  def asks({robot, what}), do: if(Keyword.has_key?(@of_robots, what), do: robot)
  def asks(_of_the_fleet), do: nil

  @impl Bridge.Catalogue
  def scene({_robot, :state} = key, ns, scene, paths), do: Topics.say(key, ns, scene, paths)
  def scene(key, ns, scene, paths), do: Topics.say(key, ns, Catalogue.drawn(scene), paths)

  @impl Bridge.Catalogue
  def about({robot, :scan}, ns, %{sonar: beams}) do
    ends =
      for [x, y, heading, range] <- beams,
          do: {x + range * :math.cos(heading), y + range * :math.sin(heading)}

    Foxglove.scene_update([Shapes.heard(ns, "#{robot}", ends)])
  end

  def about({_robot, :why}, _ns, about), do: Hal.Json.encode!(%{text: why(about)})

  @doc """
  What a robot does and why, in one line.

      iex> Bridge.Topics.why(%{by: :goto, wishes: [[:goto, 1.0], [:rest, 0.1]], limits: [:front], notes: ["blocked by mag2"],
      ...>   fault: nil, offline: [:ptz], estop: false})
      "goto decides (goto 1.0, rest 0.1); limited by front; blocked by mag2; offline: ptz"
  """
  @spec why(map()) :: String.t()
  def why(about) do
    wishes = for [by, weight] <- about.wishes, do: "#{by} #{Float.round(weight * 1.0, 2)}"

    [
      about.by && "#{about.by} decides" <> in_brackets(wishes),
      about.estop && "held by the emergency stop",
      about.limits != [] && "limited by #{Enum.join(about.limits, ", ")}",
      about.fault && "fault: #{about.fault}",
      about.notes,
      about.offline != [] && "offline: #{Enum.join(about.offline, ", ")}"
    ]
    |> List.flatten()
    |> Enum.filter(& &1)
    |> Enum.join("; ")
  end

  defp in_brackets([]), do: ""
  defp in_brackets(words), do: " (#{Enum.join(words, ", ")})"

  @impl Bridge.Catalogue
  def log, do: ["/log"]

  @impl Bridge.Catalogue
  def stage("/log", ns, %{line: line} = stage),
    do: Foxglove.log(ns, :info, "#{stage[:robot]}", line)

  def stage("/log", ns, stage), do: Facts.stage(ns, stage)

  @impl Bridge.Catalogue
  def order("/log", ns, asker, line, {ok?, text}) do
    level = if ok? == :ok, do: :info, else: :warning
    Foxglove.log(ns, level, asker, "#{line}: #{text |> List.wrap() |> Enum.join("; ")}")
  end
end
