defmodule Lab.Chaos.ScenarioFile do
  @moduledoc """
  Writes a failing run as a scenario (`Lab.Scenario`): its text says what was violated, and it expects that it never is. Pure.
  """
  alias Lab.Chaos.Runner
  alias Lab.Check.Violation
  alias Lab.Scenario

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
             expect: [{:never, violation.invariant}]
           ) do
      name = "chaos-#{seed}-#{number}-#{violation.invariant}.exs"
      {:ok, name, Scenario.File.text(scenario)}
    end
  end

  defp default?({_key, value}) when value in [nil, []], do: true
  defp default?({_key, _value}), do: false
end
