defmodule Lab.Trial.Termination do
  @moduledoc "Decides when a run is over, in lockstep or live. Pure."
  alias Lab.Trial.{Cuts, RunLog, Script}

  @calm_ms 5_000

  @doc """
  Whether the time of a run is up, or no interventions are left and the fleet has been in
  formation, or at rest without a landmark, for 5 s.
  """
  @spec reached?(%{
          :at_ms => non_neg_integer(),
          :options => map(),
          :script => Script.t(),
          :run_log => RunLog.t(),
          :world => Sim.World.t(),
          optional(atom()) => term()
        }) :: boolean()
  def reached?(run) do
    calm_ms = RunLog.calm_since_ms(run.run_log)

    run.at_ms >= run.options.duration_s * 1000 or
      (Script.over?(run.script, run.world) and calm_ms != nil and
         run.at_ms - Enum.max([calm_ms, Script.last_ms(run.script), healed_ms(run)]) >= @calm_ms)
  end

  defp healed_ms(%{options: %{cuts: cuts}}),
    do: cuts |> Cuts.healed_ms() |> Enum.max(fn -> 0 end)

  defp healed_ms(_whole), do: 0
end
