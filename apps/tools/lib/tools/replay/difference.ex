defmodule Tools.Replay.Difference do
  @moduledoc "Finds where a replay differs from its recording, or one recording from another, for people. Pure."
  alias Console.Cli.Format

  @doc "A difference of a replay (`t:Lab.Replay.Kind.difference/0`), line by line."
  @spec lines(Lab.Replay.Kind.difference()) :: [String.t()]
  def lines({:decision, difference}) do
    role = if difference[:role], do: ", #{difference.role}", else: ""
    now = difference[:crash] || brief(difference.replayed -- difference.recorded)

    [
      "#{at(difference.at_ms)} #{difference.robot}#{role}, on #{brief(difference.input)}",
      "  did then: #{brief(difference.recorded -- difference.replayed)}",
      "  does now: #{now}"
    ]
  end

  def lines({:world, difference}) do
    [
      "#{at(difference.at_ms)} the sensors of #{difference.robot}",
      "  said then: #{brief(difference.recorded)}",
      "  say now:   #{brief(difference.replayed)}"
    ]
  end

  def lines({:unknown, robot, at_ms}),
    do: ["#{at(at_ms)} #{robot} was told something, but is not there"]

  @doc "Where two recordings part."
  @spec parted(Record.Recording.Comparison.difference()) :: [String.t()]
  def parted(%{at_ms: at_ms, entries: {one, other}}) do
    ["The two part in the tick that ends at #{at(at_ms)}:", "  one:   #{entry(one)}"] ++
      ["  other: #{entry(other)}"] ++ detail(one, other)
  end

  defp entry(nil), do: "nothing more in this tick"
  defp entry({:world, at_ms, event}), do: "#{at(at_ms)} world: #{brief(event)}"

  defp entry({:step, robot, input, effects}),
    do: "#{at(Record.Replay.Member.at_ms(input))} #{robot} on #{brief(input)}: #{brief(effects)}"

  defp entry({robot, {role, kind, what, at_ms}}),
    do: "#{at(at_ms)} #{robot}, #{role}, #{kind}: #{brief(what)}"

  # The same robot on the same input has done something else.
  defp detail({:step, robot, input, one}, {:step, robot, input, other}),
    do: ["  #{robot} did #{brief(one -- other)} in one, #{brief(other -- one)} in the other"]

  defp detail(_one, _other), do: []

  @doc "In what two starts differ, by the names of their options."
  @spec options(map(), map()) :: String.t()
  def options(one, other) do
    keys = for {key, value} <- Enum.sort(one), other[key] != value, do: key

    case keys do
      [] ->
        "in what was built from the same options"

      keys ->
        Enum.map_join(
          keys,
          ", ",
          &"#{&1} #{brief(one[&1])} and #{brief(other[&1])}"
        )
    end
  end

  defp at(at_ms), do: "#{Format.decimals(at_ms / 1000, 2)} s"
  defp brief(term), do: inspect(term, limit: 12, printable_limit: 120, width: 100_000)
end
