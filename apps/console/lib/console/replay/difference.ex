defmodule Console.Replay.Difference do
  @moduledoc "Finds where a replay differs from its recording, or one recording from another, for people. Pure."
  alias Console.Cli.Format

  @doc "A difference of a replay (`t:Sim.Replay.difference/0`), line by line."
  @spec lines(Sim.Replay.difference()) :: [String.t()]
  def lines({:decision, difference}) do
    [
      "#{at(difference.at_ms)} #{difference.robot}, on #{brief(difference.input)}",
      "  did then: #{brief(difference.recorded -- difference.replayed)}",
      "  does now: #{brief(difference.replayed -- difference.recorded)}"
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
  @spec parted(Sim.Recording.Comparison.difference()) :: [String.t()]
  def parted(%{at_ms: at_ms, entries: {one, other}}) do
    ["The two part in the tick that ends at #{at(at_ms)}:", "  one:   #{entry(one)}"] ++
      ["  other: #{entry(other)}"] ++ detail(one, other)
  end

  defp entry(nil), do: "nothing more in this tick"
  defp entry({:world, at_ms, event}), do: "#{at(at_ms)} world: #{brief(event)}"

  defp entry({:step, robot, input, effects}),
    do: "#{at(Swarm.Replay.at_ms(input))} #{robot} on #{brief(input)}: #{brief(effects)}"

  # The same robot on the same input has done something else.
  defp detail({:step, robot, input, one}, {:step, robot, input, other}),
    do: ["  #{robot} did #{brief(one -- other)} in one, #{brief(other -- one)} in the other"]

  defp detail(_one, _other), do: []

  @doc "In what two starts differ, by the names of their options."
  @spec setups(Sim.Trial.Setup.t(), Sim.Trial.Setup.t()) :: String.t()
  def setups(one, other) do
    keys = for {key, value} <- Enum.sort(one.options), other.options[key] != value, do: key

    case keys do
      [] ->
        "in what was built from the same options"

      keys ->
        Enum.map_join(
          keys,
          ", ",
          &"#{&1} #{brief(one.options[&1])} and #{brief(other.options[&1])}"
        )
    end
  end

  defp at(at_ms), do: "#{Format.decimals(at_ms / 1000, 2)} s"
  defp brief(term), do: inspect(term, limit: 12, printable_limit: 120, width: 100_000)
end
