defmodule Console.Scenario.Report do
  @moduledoc "Writes what `mix scenario` prints about a run, as lines. Pure."
  alias Console.Cli.{Format, MapName}
  alias Console.Fleet
  alias Lab.{Check, Scenario}
  alias Lab.Scenario.Text

  @doc "The first lines: the file, what it is for, and the robots."
  @spec heading(Path.t(), Scenario.t(), Lab.Trial.t()) :: [String.t()]
  def heading(file, scenario, %{options: options} = trial) do
    robots = Format.count(length(options.robots), "robot")
    about = if scenario.about == "", do: "", else: ": " <> scenario.about

    [
      "#{file}#{about}",
      "#{robots} (#{Fleet.describe(options.robots)}) in #{options.map}" <>
        MapName.grey(trial, "grey: :floor") <> ", seed #{options.seed}"
    ]
  end

  @doc "One line for each expectation."
  @spec verdicts([Check.verdict()]) :: [String.t()]
  def verdicts(verdicts), do: Enum.map(verdicts, &verdict/1)

  @doc """
  The line of an expectation: whether it held, when that was decided, and the figures.

      iex> Console.Scenario.Report.verdict(%{expectation: {:formed, [by_s: 60.0]}, held?: false, at_s: 60.0, figures: "no robot leads"})
      "   60.0 s  FAILED  {:formed, by_s: 60}: no robot leads"
  """
  @spec verdict(Check.verdict()) :: String.t()
  def verdict(verdict) do
    at_s = verdict.at_s |> Format.decimals(1) |> String.pad_leading(7)
    word = %{true: "held  ", false: "FAILED", nil: "?     "}[verdict.held?]
    "#{at_s} s  #{word}  #{Text.form(verdict.expectation)}: #{verdict.figures}"
  end

  @doc """
  The last line about one file.

      iex> Console.Scenario.Report.summary("a.exs", 61.25, [%{held?: true}, %{held?: false}])
      "a.exs: 1 of 2 expectations failed, after 61.3 s"
      iex> Console.Scenario.Report.summary("a.exs", 61.25, [%{held?: true}, %{held?: nil}])
      "a.exs: 2 expectations held but for 1 that nothing looked at, after 61.3 s"
  """
  @spec summary(Path.t(), float(), [%{:held? => boolean() | nil, optional(atom()) => term()}]) ::
          String.t()
  def summary(file, at_s, verdicts) do
    count = length(verdicts)
    seconds = Format.decimals(at_s, 1)

    case {Enum.count(verdicts, &(&1.held? == false)), Enum.count(verdicts, &(&1.held? == nil))} do
      _any when count == 0 ->
        "#{file}: nothing was expected, after #{seconds} s"

      {0, 0} ->
        "#{file}: #{expectations(count)} held, after #{seconds} s"

      {0, unknown} ->
        "#{file}: #{expectations(count)} held but for #{unknown} that nothing looked at, after #{seconds} s"

      {failed, _unknown} ->
        "#{file}: #{failed} of #{expectations(count)} failed, after #{seconds} s"
    end
  end

  defp expectations(1), do: "1 expectation"
  defp expectations(count), do: "#{count} expectations"

  @doc """
  The last line about several files.

      iex> Console.Scenario.Report.total(20, ["a.exs"])
      "1 of 20 scenarios failed: a.exs"
      iex> Console.Scenario.Report.total(20, [])
      "All 20 scenarios held."
  """
  @spec total(pos_integer(), failed :: [Path.t()]) :: String.t()
  def total(count, []), do: "All #{count} scenarios held."

  def total(count, failed),
    do: "#{length(failed)} of #{count} scenarios failed: #{Enum.join(failed, ", ")}"
end
