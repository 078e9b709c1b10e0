defmodule Tools.Replay.Why do
  @moduledoc "Explains to people why a robot did what it did at one tick (`t:Record.Replay.Member.reasons/0`). Pure."
  alias Console.Cli.Format
  alias Hal.{Pose, Twist}
  alias Robot.{Percept, Wish}
  alias Record.Recording.Topics

  @doc "The reasons of a robot at a time in seconds, line by line."
  @spec lines(atom(), number(), Record.Replay.Member.reasons()) :: [String.t()]
  def lines(robot, at_s, reasons) do
    ["#{robot} at #{Format.decimals(at_s, 1)} s"] ++
      section("perceived", percept(reasons.percept)) ++
      section("wishes, the strongest first", wishes(reasons.wishes)) ++
      section("gate", gate(reasons)) ++
      section("mission", mission(reasons)) ++
      section("did", effects(reasons.effects))
  end

  defp section(_title, []), do: []
  defp section(title, lines), do: ["#{title}:" | Enum.map(lines, &"  #{&1}")]

  defp percept(%Percept{} = percept) do
    [
      place(percept),
      sees(percept.detections),
      near(percept.sonar),
      bumpers(percept.bumpers)
      | for({id, peer} <- Enum.sort(percept.peers), do: hears(id, peer, percept.at_ms))
    ]
    |> Enum.reject(&is_nil/1)
  end

  defp place(%{pose: nil}), do: "does not know where it is"

  defp place(%{pose: pose, uncertainty: uncertainty}) do
    within =
      if uncertainty, do: ", within #{metres(uncertainty.radius)} in 95 of 100 cases", else: ""

    "believes to be at #{pose(pose)}#{within}"
  end

  defp sees(nil), do: "no fresh picture"
  defp sees(%{blobs: []}), do: "sees nothing of a known colour"

  defp sees(%{blobs: blobs}) do
    counted =
      blobs
      |> Enum.frequencies_by(& &1.colour)
      |> Enum.sort()
      |> Enum.map_join(", ", fn {name, count} -> "#{count} x #{name}" end)

    "sees #{counted}"
  end

  defp near([_ | _] = ranges), do: "nearest echo #{metres(Enum.min(ranges))}"
  defp near(_none), do: nil

  defp bumpers([]), do: nil
  defp bumpers(pressed), do: "bumpers pressed: #{Enum.join(pressed, ", ")}"

  defp hears(id, peer, at_ms) do
    "hears #{id}, #{peer.mode}, #{Format.decimals((at_ms - peer.at_ms) / 1_000, 1)} s ago at #{pose(peer.pose)}"
  end

  defp wishes([]), do: ["none"]

  defp wishes(wishes) do
    for {{%Wish{} = wish, weight}, n} <- Enum.with_index(wishes) do
      chosen = if n == 0, do: "  <- chosen", else: ""
      goal = if wish.goal, do: ", to reach #{point(wish.goal)}", else: ""
      "#{Format.decimals(weight, 2)}  #{wish.by}: #{twist(wish.twist)}#{goal}#{chosen}"
    end
  end

  defp gate(%{driving: nil}), do: ["has let nothing through yet"]

  defp gate(%{driving: %{twist: twist, limits: limits}}),
    do: ["lets #{twist(twist)} through, #{limited(limits) || "no limit"}"]

  @doc "What a gate lets through, and what limits it."
  @spec driving(%{twist: Twist.t(), limits: [atom()]}) :: String.t()
  def driving(%{twist: twist, limits: limits}),
    do: Enum.join([twist(twist) | List.wrap(limited(limits))], ", ")

  defp limited([]), do: nil
  defp limited(limits), do: "limited by #{Enum.join(limits, ", ")}"

  defp mission(%{mission: mission, before: before}) do
    for {label, text} <- mission do
      was = with {_label, old} when old != text <- List.keyfind(before, label, 0), do: old

      "#{String.pad_trailing(label, 8)} #{text}" <>
        if(is_binary(was), do: "  (before this tick: #{was})", else: "")
    end
  end

  defp effects(effects) do
    Enum.map(effects, fn
      {:drive, twist} -> "drive #{twist(twist)}"
      {:look, pan, _tilt} -> "look #{Format.decimals(pan * 180 / :math.pi(), 0)}° to the left"
      {:send, to, message} -> "send #{Topics.kind(message) || "a message"} to #{inspect(to)}"
      {:stage, name, facts} -> "tell people: #{name} #{inspect(facts)}"
    end)
  end

  defp twist(%Twist{linear: linear, turn: turn}),
    do: "#{Format.decimals(linear, 2)} m/s, #{Format.decimals(turn * 180 / :math.pi(), 0)}°/s"

  defp pose(%Pose{x: x, y: y, heading: heading}),
    do: "#{point({x, y})} facing #{Format.decimals(heading * 180 / :math.pi(), 0)}°"

  defp point({x, y}), do: "(#{Format.decimals(x, 2)}, #{Format.decimals(y, 2)})"
  defp metres(metres), do: "#{Format.decimals(metres, 2)} m"
end
