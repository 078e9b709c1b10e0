defmodule Tools.Replay.Verdict do
  @moduledoc "Describes what came of a replay, line by line, and as an exit status. Pure."
  alias Console.Cli.Format
  alias Tools.Replay.Difference
  alias Lab.Replay.Kind

  @doc "Whether something could not be compared, because it was not recorded."
  @spec gaps?(Kind.compared()) :: boolean()
  def gaps?(compared), do: compared.lost > 0 or compared.skipped > 0

  @doc "2 if something differs, or was not compared, else 0."
  @spec status(Kind.compared(), differences :: non_neg_integer()) :: 0 | 2
  def status(compared, count),
    do: if(count > 0 or gaps?(compared) or nothing?(compared), do: 2, else: 0)

  # A run in lockstep has a state from the beginning.
  defp nothing?(compared), do: compared.decisions == 0 and not compared.world?

  @doc "What came of the comparison of so many ms; `shown` are the first of `count` differences."
  @spec lines(Kind.compared(), at_ms :: integer(), [Kind.difference()], non_neg_integer()) ::
          [String.t()]
  def lines(compared, at_ms, shown, count),
    do: Enum.map(compared.parts, &part/1) ++ result(compared, at_ms, shown, count)

  defp part({{id, role}, counts}) do
    said =
      [
        Format.count(counts.inputs, "input"),
        Format.count(counts.decisions, "decision") <> " as recorded",
        counts.checked > 0 && "#{Format.count(counts.checked, "checkpoint")} reached",
        counts.begun > 1 && "begun #{counts.begun} times",
        counts.early > 0 && "#{entries(counts.early)} before its first state",
        counts.lost > 0 && "#{entries(counts.lost)} LOST",
        counts.skipped > 0 && "#{entries(counts.skipped)} NOT COMPARED"
      ]
      |> Enum.filter(&is_binary/1)

    "  #{String.pad_trailing("#{id}", 7)}#{String.pad_trailing("#{role}", 10)}#{Enum.join(said, ", ")}"
  end

  defp entries(1), do: "1 entry"
  defp entries(count), do: "#{count} entries"

  defp result(compared, at_ms, [], 0) do
    cond do
      nothing?(compared) ->
        ["Nothing could be compared: the recording has no state of a robot from which to go on."]

      gaps?(compared) ->
        [
          "#{replayed(compared, at_ms)}, but NOT ALL OF IT COULD BE COMPARED: " <>
            "#{entries(compared.lost)} lost, #{entries(compared.skipped)} without a state before. " <>
            "What was compared is as recorded: #{Format.count(compared.decisions, "decision")} on " <>
            "#{Format.count(compared.inputs, "input")}."
        ]

      true ->
        world = if compared.world?, do: ", and all readings of the world,", else: ""

        [
          "#{replayed(compared, at_ms)}: all #{compared.decisions} decisions on " <>
            "#{compared.inputs} inputs#{world} are as recorded."
        ]
    end
  end

  defp result(_compared, _at_ms, shown, count) do
    times = if count == 1, do: "once", else: "#{count} times"

    [
      "The replay differs from the recording #{times}, first in this:"
      | Enum.flat_map(shown, &Difference.lines/1)
    ]
  end

  defp replayed(compared, at_ms) do
    ids = for {{id, _role}, _counts} <- compared.parts, uniq: true, do: id
    robots = if ids == [], do: "", else: " of #{Enum.join(ids, ", ")}"
    "#{Format.seconds(at_ms)}#{robots} replayed"
  end
end
