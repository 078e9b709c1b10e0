defmodule Missions.Patrol.Motivation do
  @moduledoc """
  Computes ALLIANCE's motivations (Parker 1998), for one robot and any number of tasks, numbered from 0. Pure; ms.

  Each tick a task's motivation grows by the robot's impatience, and is 0 while its sensors say that there is nothing to
  do, while the robot is at another task, when it hears for the first time that a robot takes this one, and
  when it gives way. Over the threshold the robot takes the task.

      m(t) = (m(t-1) + impatience) * sensory * suppression * reset * acquiescence

  | sign | here | meaning |
  |---|---|---|
  | theta | 100 | the threshold |
  | fast | 20 to 40 /s | impatience if no robot is at it; the nearer the robot, the faster, so that the nearest takes it |
  | slow | 2 /s | while a robot is at it that is heard |
  | tau | 5 s | a robot that is silent for longer is at nothing |
  | phi | 30 s | no robot is waited for longer than this, heard or not |
  | psi | 30 s | a robot that is at it for longer gives way to another that is |
  | lambda | 60 s | and after this to none in particular |

  So a task of a robot that fell silent is taken over at most tau + theta/fast after its last word, if another robot is free
  (`takeover_ms/0`).
  """

  @theta 100.0
  @fast 20.0
  @slow 2.0
  @tau_ms 5_000
  @phi_ms 30_000
  @psi_ms 30_000
  @lambda_ms 60_000

  defstruct active: nil, since_ms: 0, m: %{}, known: []

  @typedoc """
  `active` is the task that the robot is at, since `since_ms`; `m` its motivations; `known` are the pairs of
  task and robot that have reset it.
  """
  @type t :: %__MODULE__{
          active: non_neg_integer() | nil,
          since_ms: integer(),
          m: %{non_neg_integer() => float()},
          known: [{non_neg_integer(), atom()}]
        }

  @typedoc "What is known of a task: whether there is something to do, and how far it is, in metres."
  @type task :: %{number: non_neg_integer(), needed?: boolean(), far: float()}

  @typedoc "What another robot said at `at_ms`: the task that it is at, how far from it, and for how long."
  @type peer :: %{
          at_ms: integer(),
          doing: non_neg_integer() | nil,
          far: float(),
          busy_ms: non_neg_integer()
        }

  @doc "The longest time from a robot's last word to the take-over of its task by a free one."
  @spec takeover_ms() :: pos_integer()
  def takeover_ms, do: @tau_ms + round(@theta / @fast * 1_000)

  @doc "Whether a robot that said something then is still at what it said."
  @spec heard?(peer(), integer()) :: boolean()
  def heard?(peer, now_ms), do: now_ms - peer.at_ms < @tau_ms

  @doc """
  One tick, `step_ms` after the last. Two that have taken the same task at once hear of each other: the farther gives
  way, or of equally far ones the one whose name sorts later.

      iex> alias Missions.Patrol.Motivation
      iex> tasks = [%{number: 0, needed?: true, far: 100.0}, %{number: 1, needed?: false, far: 1.0}]
      iex> tick = fn now_ms, m -> Motivation.tick(m, :mag1, tasks, %{}, now_ms, 100) end
      iex> at = fn ms -> Enum.reduce(1..div(ms, 100), %Motivation{}, &tick.(&1 * 100, &2)).active end
      iex> {at.(4_500), at.(5_000)}
      {nil, 0}
  """
  @spec tick(t(), atom(), [task()], %{atom() => peer()}, integer(), non_neg_integer()) :: t()
  def tick(motivation, me, tasks, peers, now_ms, step_ms) do
    peers = for {id, peer} <- peers, heard?(peer, now_ms), do: {id, peer}
    motivation = motivation |> keep(me, tasks, peers, now_ms) |> forget(tasks)

    {m, known} =
      Enum.map_reduce(
        tasks,
        motivation.known,
        &grow(&1, &2, motivation, peers, {now_ms, step_ms})
      )

    motivation = %{motivation | m: Map.new(m), known: known}

    case motivation.active == nil &&
           Enum.max_by(m, fn {number, m} -> {m, -number} end, fn -> nil end) do
      {number, most} when most >= @theta -> %{motivation | active: number, since_ms: now_ms}
      _none -> motivation
    end
  end

  @doc "The robot ends its task, whatever became of it."
  @spec leave(t()) :: t()
  def leave(motivation), do: %{motivation | active: nil}

  @doc """
  Whether the robot goes on with its task: it leaves one that is done, one that it gets nowhere with, and one at which a
  nearer robot is, of `peers` that are heard.
  """
  @spec keep(t(), atom(), [task()], [{atom(), peer()}], integer()) :: t()
  def keep(%{active: nil} = motivation, _me, _tasks, _peers, _now_ms), do: motivation

  def keep(%{active: active} = motivation, me, tasks, peers, now_ms) do
    task = Enum.find(tasks, &(&1.number == active))
    for_ms = now_ms - motivation.since_ms
    others = for {id, %{doing: ^active} = peer} <- peers, do: {id, peer}
    nearer? = fn {id, peer} -> {peer.far, id} < {task.far, me} and peer.busy_ms < @phi_ms end

    cond do
      not task.needed? -> leave(motivation)
      for_ms > @lambda_ms -> leave(motivation)
      for_ms > @psi_ms and others != [] -> leave(motivation)
      Enum.any?(others, nearer?) -> leave(motivation)
      true -> motivation
    end
  end

  # A robot that took a task that is done may reset it again when it takes the next one of this place.
  defp forget(motivation, tasks) do
    needed = for %{needed?: true, number: number} <- tasks, do: number

    %{
      motivation
      | known: for({number, _id} = pair <- motivation.known, number in needed, do: pair)
    }
  end

  defp grow(%{number: number} = task, known, motivation, peers, {now_ms, step_ms}) do
    at_it = for {id, %{doing: ^number} = peer} <- peers, do: {id, peer}
    new = for {id, _peer} <- at_it, {number, id} not in known, do: {number, id}
    suppressed? = motivation.active != nil
    waits? = Enum.any?(at_it, fn {_id, peer} -> peer.busy_ms + now_ms - peer.at_ms < @phi_ms end)
    rate = if waits?, do: @slow, else: @fast * (1 + 1 / (1 + task.far))

    m =
      if task.needed? and not suppressed? and new == [],
        do: min(Map.get(motivation.m, number, 0.0) + rate * step_ms / 1_000, 2 * @theta),
        else: 0.0

    {{number, m}, if(task.needed?, do: new ++ known, else: known)}
  end
end
