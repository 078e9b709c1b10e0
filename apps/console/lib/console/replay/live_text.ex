defmodule Console.Replay.LiveText do
  @moduledoc "Describes what `mix replay` says of a recording of robots of processes, line by line. Pure."
  alias Robot.Recording
  alias Console.Cli.Format
  alias Console.Replay.{Options, Why}
  alias Hal.{Pose, Twist}
  alias Robot.Replay

  @doc "The first line: what the file has."
  @spec heading(Recording.File.t()) :: String.t()
  def heading(%Recording.File{} = file) do
    ids = Recording.File.ids(file)
    {:ok, began} = DateTime.from_unix(div(file.start_ms, 1000))

    "#{file.path}: #{Format.count(length(ids), "live robot")} (#{Enum.join(ids, ", ")}), " <>
      "#{seconds(file.end_ms - file.start_ms)}, from #{DateTime.to_string(began)}" <>
      if(file.whole?, do: "", else: " (not ended in order: read as far as it is whole)")
  end

  @doc "How the robots stood at the end of the replay, at this second, and why, as the options ask."
  @spec moment(Options.t(), Recording.File.t(), Replay.t(), at_s :: number()) :: [String.t()]
  def moment(options, file, replay, at_s) do
    ids = for id <- Recording.File.ids(file), options.robot in [nil, Atom.to_string(id)], do: id
    shown = if options.at_s || options.robot, do: Enum.map(ids, &stood(replay, &1)), else: []

    shown ++
      for id <- Recording.File.ids(file),
          "#{id}" == options.why,
          line <- why(replay, id, at_s),
          do: line
  end

  defp stood(replay, id) do
    reasons = reasons(replay, id)
    pilot = Replay.state(replay, id, :pilot)

    words = [
      pilot && phase(pilot.state),
      reasons && place(reasons.percept),
      reasons && reasons.driving && driving(reasons.driving)
    ]

    case Enum.reject(words, &(&1 == nil)) do
      [] -> "#{id}: nothing is known of it yet"
      words -> "#{id}: #{Enum.join(words, "; ")}"
    end
  end

  defp reasons(replay, id) do
    with %{} = moment <- Replay.moment(replay, id), do: Replay.Moment.reasons(moment)
  end

  defp phase({mission, phase}), do: "#{phase} of #{inspect(mission)}"
  defp phase(:idle), do: "idle"

  defp place(%{pose: nil}), do: "does not know where it is"

  defp place(%{pose: %Pose{} = pose}),
    do:
      "at (#{Format.decimals(pose.x, 2)}, #{Format.decimals(pose.y, 2)}) facing " <>
        "#{Format.decimals(pose.heading * 180 / :math.pi(), 0)}°, as it believes"

  defp driving(%{twist: %Twist{linear: linear, turn: turn}, limits: limits}) do
    by = if limits == [], do: "", else: ", limited by #{Enum.join(limits, ", ")}"

    "drives #{Format.decimals(linear, 2)} m/s, " <>
      "#{Format.decimals(turn * 180 / :math.pi(), 0)}°/s#{by}"
  end

  defp why(replay, id, at_s) do
    case reasons(replay, id) do
      nil -> ["#{id} had decided nothing yet."]
      reasons -> Why.lines(id, at_s, reasons)
    end
  end

  @doc "Whether something was compared, and nothing is missing between."
  @spec whole?(Replay.t()) :: boolean()
  def whole?(replay) do
    counts = Replay.counts(replay)
    sum(counts, :decisions) > 0 and sum(counts, :lost) == 0 and sum(counts, :skipped) == 0
  end

  @doc "What came of the comparison; `shown` are the first of `count` differences."
  @spec verdict(
          Recording.File.t(),
          Replay.t(),
          non_neg_integer(),
          [Replay.difference()],
          non_neg_integer()
        ) ::
          [String.t()]
  def verdict(file, replay, last_ms, shown, count) do
    counts = Replay.counts(replay)
    parts = for {{id, role}, counts} <- counts, do: part(id, role, counts)
    parts ++ result(file, replay, counts, last_ms, shown, count)
  end

  defp part(id, role, counts) do
    said =
      [
        Format.count(counts.inputs, "input"),
        Format.count(counts.decisions, "decision") <> " as recorded",
        some(counts.checked, "checkpoint") && "#{some(counts.checked, "checkpoint")} reached",
        counts.begun > 1 && "begun #{counts.begun} times",
        some(counts.early, "entry") && "#{entries(counts.early)} before its first state",
        some(counts.lost, "entry") && "#{entries(counts.lost)} LOST",
        some(counts.skipped, "entry") && "#{entries(counts.skipped)} NOT COMPARED"
      ]
      |> Enum.filter(&is_binary/1)

    "  #{String.pad_trailing("#{id}", 7)}#{String.pad_trailing("#{role}", 10)}#{Enum.join(said, ", ")}"
  end

  defp some(0, _what), do: nil
  defp some(count, what), do: Format.count(count, what)
  defp entries(1), do: "1 entry"
  defp entries(count), do: "#{count} entries"

  defp result(_file, replay, counts, last_ms, [], 0) do
    cond do
      sum(counts, :decisions) == 0 ->
        ["Nothing could be compared: the recording has no state of a robot from which to go on."]

      whole?(replay) ->
        [
          "#{replayed(counts, last_ms)}: all #{sum(counts, :decisions)} decisions on " <>
            "#{sum(counts, :inputs)} inputs are as recorded."
        ]

      true ->
        [
          "#{replayed(counts, last_ms)}, but NOT ALL OF IT COULD BE COMPARED: " <>
            "#{entries(sum(counts, :lost))} lost, #{entries(sum(counts, :skipped))} " <>
            "without a state before. What was compared is as recorded: #{compared(counts)}."
        ]
    end
  end

  defp result(file, _replay, _counts, _last_ms, shown, count) do
    [
      "The replay differs from the recording #{times(count)}, first in this:"
      | Enum.flat_map(shown, &difference(file, &1))
    ]
  end

  defp times(1), do: "once"
  defp times(count), do: "#{count} times"

  defp replayed(counts, last_ms) do
    ids = counts |> Enum.map(fn {{id, _role}, _counts} -> id end) |> Enum.uniq()
    "#{seconds(last_ms)} of #{Enum.join(ids, ", ")} replayed"
  end

  defp compared(counts),
    do:
      "#{Format.count(sum(counts, :decisions), "decision")} on " <>
        Format.count(sum(counts, :inputs), "input")

  defp sum(counts, what), do: counts |> Enum.map(fn {_key, all} -> all[what] end) |> Enum.sum()

  defp difference(file, difference) do
    at_s = Recording.File.since_start_ms(file, difference.robot, difference.at_ms) / 1000

    [
      "#{Format.decimals(at_s, 2)} s #{difference.robot}, #{difference.role}, on #{brief(difference.input)}",
      "  did then: #{brief(difference.recorded -- difference.replayed)}",
      "  does now: #{difference.crash || brief(difference.replayed -- difference.recorded)}"
    ]
  end

  defp brief(term), do: inspect(term, limit: 12, printable_limit: 120, width: 100_000)
  defp seconds(ms), do: "#{Format.decimals(ms / 1000, 1)} s"
end
