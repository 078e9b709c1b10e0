defmodule Bench.Run do
  @moduledoc "Runs a case once: what is done to the fleet, and what is measured. No process."

  alias Hal.Pose

  @calm_ms 2_000
  @rest_ms 5_000
  @push_m 3.0

  @typedoc """
  `formed_s` is `nil` if the fleet did not form (again) before its time was up. `claims` are all
  claims of the run, including those before the intervention; `stuck` counts robots that stood
  short of their places without reporting it (`Lab.Trial.Progress`).
  """
  @type measured :: %{
          formed_s: float() | nil,
          within?: boolean(),
          error: {mean :: float(), max :: float()} | nil,
          collisions: non_neg_integer(),
          leaders: non_neg_integer(),
          changes: non_neg_integer(),
          claims: [Lab.Trial.Claims.claim()],
          stuck: non_neg_integer(),
          speed: float()
        }

  @doc "Runs one case with one seed."
  @spec run(Bench.case(), String.t(), integer(), :painted | :direct, module()) ::
          {:ok, measured()} | {:error, String.t()}
  def run(case, map, seed, blobs, module) do
    options = Bench.options(case, map, seed, blobs)
    started = System.monotonic_time(:microsecond)

    with {:ok, trial} <- module.new(options) do
      state = %{
        case: case,
        limit_s: Bench.limit_s(case, map),
        module: module,
        end_ms: round(options.duration_s * 1000),
        since_ms: nil,
        deed_ms: nil,
        formed_ms: nil,
        changes: 0
      }

      {trial, state} = play(trial, state)
      wall_s = max(System.monotonic_time(:microsecond) - started, 1) / 1.0e6
      {:ok, measure(trial, state, wall_s)}
    end
  end

  defp play(trial, state) do
    trial = state.module.step(trial)
    at_ms = trial.at_ms
    formed? = state.module.formed?(trial)
    state = %{state | since_ms: if(formed?, do: state.since_ms || at_ms)}
    calm_ms = if state.since_ms, do: at_ms - state.since_ms, else: -1

    cond do
      at_ms >= state.end_ms ->
        {trial, note(state)}

      state.case.deed == nil and state.module.done?(trial) ->
        {trial, note(state)}

      state.case.deed != nil and state.deed_ms == nil and calm_ms >= @calm_ms ->
        changes = state.module.result(trial).leader_changes
        trial = act(state.case.deed, trial, state.module)
        # Until the fleet notices, it still considers itself formed.
        play(trial, %{
          state
          | deed_ms: at_ms,
            since_ms: nil,
            changes: changes,
            end_ms: deed_end(state, at_ms)
        })

      state.deed_ms != nil and calm_ms >= @rest_ms and at_ms - state.deed_ms > 2 * @rest_ms ->
        {trial, note(state)}

      true ->
        play(trial, state)
    end
  end

  defp deed_end(state, at_ms),
    do: max(state.end_ms, at_ms + round(state.limit_s * 1000) + @rest_ms)

  defp note(state), do: %{state | formed_ms: state.since_ms}

  defp act(:kill_leader, trial, module), do: module.kill(trial, :leader)

  defp act(:kill_middle, trial, module) do
    followers =
      trial
      |> module.result()
      |> Map.fetch!(:fleet)
      |> Enum.filter(&(is_integer(&1.slot) and &1.slot > 0))

    middle = Enum.sort_by(followers, & &1.slot) |> Enum.at(div(length(followers) - 1, 2))
    module.kill(trial, middle.name)
  end

  # Away from where it is, in the first open direction, beginning at the leader's left.
  defp act(:move, trial, module) do
    scene = module.scene(trial)
    leader = Enum.find(scene.robots, & &1.leader?)
    landmark = scene.landmark

    Enum.find_value([1, -1, 2, -2, 0, 3, -3, 4], trial, fn quarter ->
      place = push(leader.pose, landmark, quarter * :math.pi() / 4)

      case module.move(trial, place) do
        {:ok, trial} -> trial
        {:error, _line} -> nil
      end
    end)
  end

  defp push(pose, {x, y}, angle) do
    direction = pose.heading + Pose.bearing(pose, {x, y}) + angle
    {x + @push_m * :math.cos(direction), y + @push_m * :math.sin(direction)}
  end

  defp measure(trial, state, wall_s) do
    result = state.module.result(trial)
    from_ms = state.deed_ms || 0
    done? = state.formed_ms != nil and (state.case.deed == nil or state.deed_ms != nil)
    formed_s = if done?, do: (state.formed_ms - from_ms) / 1000
    mean = result.formation.error_mean_m

    %{
      formed_s: formed_s,
      within?: formed_s != nil and formed_s <= state.limit_s,
      error: if(done? and mean, do: {mean, result.formation.error_max_m}),
      collisions: result.collisions,
      leaders: result.leaders_at_once_max,
      changes: result.leader_changes - state.changes,
      claims: result.claims,
      stuck: length(result.stuck),
      speed: result.simulated_s / wall_s
    }
  end
end
