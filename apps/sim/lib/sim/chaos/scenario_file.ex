defmodule Sim.Chaos.ScenarioFile do
  @moduledoc """
  Writes a failing run as a scenario (`Sim.Scenario`): its text says what was violated, and it expects that it is not,
  where scenarios have a word for it. Pure.
  """
  alias Sim.Chaos.{Runner, Violation}
  alias Sim.Scenario

  # What scenarios can expect, of what invariant.
  @expected %{
    collision: {:no_collision},
    stuck: {:never_stuck},
    false_claim: {:claims_true},
    bad_anchor: {:slots_unique},
    two_leaders: {:at_most_one_leader, grace_s: 1.8}
  }

  @doc "The file's name and text of a failure of a seed."
  @spec text(integer(), Runner.failure()) ::
          {:ok, name :: String.t(), text :: String.t()} | {:error, String.t()}
  def text(seed, failure) do
    %{number: number, violation: violation, smallest: smallest, again: again} = failure
    {script, options} = Keyword.pop(smallest, :script, [])

    about =
      "Run #{number} of seed #{seed}: " <>
        Violation.line(violation) <> ". Shrunk: " <> Violation.line(again) <> "."

    with {:ok, scenario} <-
           Scenario.new(
             about: String.slice(about, 0, 1_900),
             # Its runs have no plan; those of a file have one where they do not say.
             options: Keyword.put_new(Enum.reject(options, &default?/1), :plan, :none),
             script: script,
             expect:
               for({:ok, expected} <- [Map.fetch(@expected, violation.invariant)], do: expected)
           ) do
      name = "chaos-#{seed}-#{number}-#{violation.invariant}.exs"
      {:ok, name, Scenario.File.text(scenario)}
    end
  end

  defp default?({_key, value}) when value in [nil, []], do: true
  defp default?({_key, _value}), do: false
end
