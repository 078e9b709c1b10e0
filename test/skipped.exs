defmodule Convoy.Skipped do
  @moduledoc """
  Lists at the end of a suite the tests that were skipped, with the reason of each.

  With `CONVOY_SKIPPED=FILE` the lines are appended to that file instead: `bin/test` runs many suites
  and prints them all at its end. Of those that were excluded only the ones tagged `:long` are told, and who runs
  them: whatever else was left out, somebody asked for that.
  """
  use GenServer

  @impl GenServer
  def init(_options), do: {:ok, %{}}

  @impl GenServer
  def handle_cast({:test_finished, %ExUnit.Test{state: {:skipped, reason}} = test}, skipped),
    do: {:noreply, add(skipped, test, reason)}

  def handle_cast(
        {:test_finished, %ExUnit.Test{state: {:excluded, _}, tags: %{long: true}} = test},
        skipped
      ),
      do: {:noreply, add(skipped, test, "bin/test long runs it")}

  def handle_cast({:suite_finished, _times}, skipped) do
    report(for {{module, reason}, count} <- Enum.sort(skipped), do: line(count, module, reason))
    {:noreply, skipped}
  end

  def handle_cast(_event, skipped), do: {:noreply, skipped}

  defp add(skipped, test, reason),
    do: Map.update(skipped, {inspect(test.module), reason}, 1, &(&1 + 1))

  defp line(1, module, reason), do: "1 test of #{module}: #{reason}\n"
  defp line(count, module, reason), do: "#{count} tests of #{module}: #{reason}\n"

  defp report([]), do: :ok

  defp report(lines) do
    case System.get_env("CONVOY_SKIPPED") do
      nil -> IO.puts(["\nSkipped:\n" | lines])
      file -> File.write!(file, lines, [:append])
    end
  end
end
