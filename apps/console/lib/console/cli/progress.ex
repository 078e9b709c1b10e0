defmodule Console.Cli.Progress do
  @moduledoc "Draws the line that shows how far a run is. Pure."
  alias Console.Cli.Format

  @width 24

  @doc """
  The progress line for `done` of `all` seconds, or of another unit.

      iex> Console.Cli.Progress.line(30.0, 120.0, "searching", 40)
      "[######..................]  30 of 120 s "
      iex> Console.Cli.Progress.line(30.0, 120.0, "searching", 80)
      "[######..................]  30 of 120 s  searching"
      iex> Console.Cli.Progress.line(5, 20, "", 80, "runs")
      "[######..................]  5 of 20 runs  "
  """
  @spec line(number(), number(), String.t(), pos_integer(), unit :: String.t()) :: String.t()
  def line(done, all, note, columns, unit \\ "s") do
    filled = round(@width * min(done / max(all, 0.001), 1.0))
    bar = String.duplicate("#", filled) <> String.duplicate(".", @width - filled)
    all_text = Format.decimals(all, 0)
    done_text = done |> Format.decimals(0) |> String.pad_leading(String.length(all_text))

    String.slice("[#{bar}] #{done_text} of #{all_text} #{unit}  #{note}", 0, max(columns, 1))
  end
end
