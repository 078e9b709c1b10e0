defmodule Swarm.Replacement.Job do
  @moduledoc """
  Models one replacement on one node, as a function: its robots stand, change, and go on; or go back. Pure; times are
  monotonic, in ms.

  | phase | ends when | then |
  |---|---|---|
  | `:standing` | all that were on a mission have ended it, by way of their gates, and their wheels rest; 3 s at most | the mission is tried: its options are checked, and a state is made and thrown away |
  | `:trying` | that has gone well; 2 s at most | those that were on a mission start it |
  | `:waiting` | a person starts the mission, because no robot was on one | it is watched |
  | `:watching` | 10 s have passed | it stays |
  | `:returning` | all have ended it, 3 s at most | missions are as before, and robots go on |

  What goes wrong up to the end of `:watching` leads back for all robots of the node. A robot
  that a person stops meanwhile stays where it is, and nothing starts it again. A robot that had no mission stays idle after
  a rollback.

  | effect | |
  |---|---|
  | `{:stand, id}` | end its mission; `{:stood, id}` when its gate has confirmed that |
  | `:try` | `{:tried, result}` |
  | `{:start, id, mission}` | `{:started, id, result}`, and as below |
  | `{:watch, id}` | from now on `{:crashed, id}` if its pilot ends |
  | `{:note, what, line}` | tell of all its robots that they are `:changing`, `:replaced`, `:kept` or `:back` |
  """

  @stand_ms 3_000
  @again_ms 500
  @try_ms 2_000
  @watch_ms 10_000

  @enforce_keys [:robots, :mission, :since_ms]
  defstruct @enforce_keys ++ [phase: :standing, asked_ms: 0, why: nil]

  @typedoc """
  `robots` are those of the node: `was` is the mission that one was on, with its options, `nil` if on none, or once a person
  has stopped it; `stands?` whether its gate has confirmed that. `mission` is the new one.
  """
  @type t :: %__MODULE__{
          robots: %{atom() => %{was: mission() | nil, stands?: boolean()}},
          mission: mission(),
          phase: :standing | :trying | :waiting | :watching | :returning | :done,
          since_ms: integer(),
          asked_ms: integer(),
          why: String.t() | nil
        }
  @type mission :: {module(), keyword()}

  @type event ::
          {:stood, atom()}
          | {:tried, {:ok, keyword()} | {:error, String.t()}}
          | {:started, atom(), :ok | {:error, term()}}
          | {:runs, atom()}
          | {:crashed, atom(), why :: String.t()}
          | {:gone, atom()}
          | {:tick, turning :: [atom()]}

  @type effect ::
          {:stand, atom()}
          | :try
          | {:start, atom(), mission()}
          | {:watch, atom()}
          | {:note, :changing | :replaced | :kept | :back, String.t() | nil}

  @doc "For how long a new version is watched."
  @spec watch_ms() :: pos_integer()
  def watch_ms, do: @watch_ms

  @doc "A job for robots by the missions that they are on, and its first effects."
  @spec new(%{atom() => mission() | nil}, mission(), now_ms :: integer()) :: {t(), [effect()]}
  def new(robots, mission, now_ms) do
    robots = Map.new(robots, fn {id, was} -> {id, %{was: was, stands?: false}} end)
    job = %__MODULE__{robots: robots, mission: mission, since_ms: now_ms, asked_ms: now_ms}
    next(job, [{:note, :changing, nil} | stand(job)], [], now_ms)
  end

  @doc "Handles one event."
  @spec step(t(), event(), now_ms :: integer()) :: {t(), [effect()]}
  def step(%{phase: :done} = job, _event, _now_ms), do: {job, []}

  def step(job, {:gone, id}, _now_ms) do
    job = %{job | robots: Map.delete(job.robots, id)}
    if job.robots == %{}, do: done(job, []), else: {job, []}
  end

  def step(%{phase: phase} = job, {:stood, id}, _now_ms) when phase in [:standing, :returning],
    do: {put(job, id, :stands?, true), []}

  def step(%{phase: :trying} = job, {:tried, {:ok, options}}, now_ms) do
    {module, _options} = job.mission
    phase = if on(job) == [], do: :waiting, else: :watching
    job = at(%{job | mission: {module, options}}, phase, now_ms)
    {job, [{:note, :replaced, nil} | for(id <- on(job), do: {:start, id, job.mission})]}
  end

  def step(%{phase: :waiting, robots: robots} = job, {:runs, id}, now_ms)
      when is_map_key(robots, id),
      do: {at(job, :watching, now_ms), [{:watch, id}]}

  # Those that were on a mission are watched already.
  def step(%{phase: :watching} = job, {:runs, id}, _now_ms) do
    case job.robots do
      %{^id => %{was: nil}} -> {job, [{:watch, id}]}
      _watched_or_gone -> {job, []}
    end
  end

  # It has not been started, so all still stand.
  def step(%{phase: :trying} = job, {:tried, {:error, line}}, _now_ms),
    do: resume(job, line, [])

  def step(%{phase: :watching} = job, {:started, _id, :ok}, _now_ms), do: {job, []}

  # A robot that has not begun in time, or lacks the mission, could not say why.
  def step(%{phase: :watching} = job, {:started, id, {:error, why}}, now_ms)
      when why in [:late, :no_mission, :idle],
      do: return(job, "#{id} could not start it", now_ms)

  # A person has stopped or disarmed it meanwhile.
  def step(%{phase: :watching} = job, {:started, id, {:error, _why}}, _now_ms),
    do: {put(job, id, :was, nil), []}

  def step(%{phase: :watching, robots: robots} = job, {:crashed, id, why}, now_ms)
      when is_map_key(robots, id) do
    seconds = :erlang.float_to_binary((now_ms - job.since_ms) / 1_000, decimals: 1)
    return(job, "it ended on #{id} after #{seconds} s (#{why})", now_ms)
  end

  def step(job, {:tick, turning}, now_ms), do: next(job, [], turning, now_ms)
  def step(job, _late, _now_ms), do: {job, []}

  defp next(%{phase: :standing} = job, effects, turning, now_ms) do
    late = waits(job) ++ Enum.filter(on(job), &(&1 in turning))

    cond do
      late == [] -> {at(job, :trying, now_ms), effects ++ [:try]}
      now_ms - job.since_ms >= @stand_ms -> resume(job, "#{hd(late)} does not stand", [])
      true -> again(job, effects, now_ms)
    end
  end

  defp next(%{phase: :trying} = job, effects, _turning, now_ms) do
    if now_ms - job.since_ms >= @try_ms,
      do: resume(job, "its init does not return", effects),
      else: {job, effects}
  end

  defp next(%{phase: :watching} = job, effects, _turning, now_ms) do
    if now_ms - job.since_ms >= @watch_ms,
      do: done(job, effects ++ [{:note, :kept, nil}]),
      else: {job, effects}
  end

  defp next(%{phase: :returning} = job, effects, _turning, now_ms) do
    if waits(job) == [] or now_ms - job.since_ms >= @stand_ms,
      do: resume(job, job.why, effects),
      else: again(job, effects, now_ms)
  end

  defp next(job, effects, _turning, _now_ms), do: {job, effects}

  # What was asked of a pilot that was just being started again is lost.
  defp again(job, effects, now_ms) do
    if now_ms - job.asked_ms >= @again_ms,
      do: {%{job | asked_ms: now_ms}, effects ++ stand(job)},
      else: {job, effects}
  end

  defp return(job, why, now_ms) do
    robots = Map.new(job.robots, fn {id, robot} -> {id, %{robot | stands?: false}} end)
    job = at(%{job | robots: robots, why: why, asked_ms: now_ms}, :returning, now_ms)
    next(job, [{:note, :changing, nil} | stand(job)], [], now_ms)
  end

  defp resume(job, why, effects) do
    starts = for id <- on(job), do: {:start, id, job.robots[id].was}
    done(job, effects ++ [{:note, :back, why} | starts])
  end

  defp done(job, effects), do: {%{job | phase: :done}, effects}
  defp at(job, phase, now_ms), do: %{job | phase: phase, since_ms: now_ms}
  defp put(job, id, key, value), do: update_in(job.robots, &put_known(&1, id, key, value))

  defp put_known(robots, id, key, value) do
    case robots do
      %{^id => robot} -> %{robots | id => Map.put(robot, key, value)}
      _gone -> robots
    end
  end

  defp on(job), do: for({id, %{was: was}} when was != nil <- Enum.sort(job.robots), do: id)
  defp waits(job), do: Enum.reject(on(job), &job.robots[&1].stands?)
  defp stand(job), do: for(id <- waits(job), do: {:stand, id})
end
