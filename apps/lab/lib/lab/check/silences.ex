defmodule Lab.Check.Silences do
  @moduledoc false
  # Judges `stuck` (`Lab.Trial.Progress`): no robot is short of its slot for 20 s without a word, but one that was frozen
  # meanwhile and could not report it. Pure.
  @behaviour Lab.Check.Kind
  import Lab.Check.Violation, only: [decimals: 2]
  alias Lab.Check.Violation
  alias Lab.Trial.Progress

  @impl Lab.Check.Kind
  def new(_options), do: 0

  @impl Lab.Check.Kind
  def note(_asked, %{at_ms: at_ms, faults: faults, run_log: log}, known) do
    told = Progress.report(log.stuck)

    wrong =
      for %{robot: id, at_s: at_s, error_m: error_m} <- Enum.drop(told, known),
          not frozen_since?(faults, id, round(at_s * 1000)) do
        figures = "#{decimals(error_m, 2)} m off since #{decimals(at_s, 1)} s, and says nothing"
        Violation.new(:stuck, at_ms, [id], figures)
      end

    {:never, wrong, length(told)}
  end

  defp frozen_since?(faults, id, since_ms) do
    Enum.any?(faults.all, fn {kind, robot, _from_ms, to_ms} ->
      {kind, robot} == {:frozen, id} and to_ms > since_ms
    end)
  end
end
