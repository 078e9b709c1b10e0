defmodule Console.Live.Mesh.View do
  @moduledoc false
  # Describes what is shown of the robots of a mesh, from one look at their status to the next: a scene without a map, and what has
  # changed as lines. Pure.
  #
  # Poses are those of the status, each with the number of its frame (`Console.Live.Mesh.Frames`): robots of different ones
  # are not drawn on one floor.
  alias Console.Live.Mesh.Frames
  alias Sim.Scene
  alias Swarm.Status

  # Older lines are forgotten.
  @most_stages 200

  defstruct statuses: %{},
            order: [],
            gone: MapSet.new(),
            places: %{},
            stages: [],
            told: 0,
            estop: nil

  @type t :: %__MODULE__{
          statuses: %{atom() => Status.t()},
          order: [atom()],
          gone: MapSet.t(atom()),
          places: %{atom() => Frames.place()},
          stages: [map()],
          told: non_neg_integer(),
          estop: Scene.estop() | nil
        }

  @doc "The view before any robot is heard."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc """
  The next look: of robots that are not in it the last status is kept, and that they are gone. `clock` is the time of day as
  people read it.

      iex> alias Console.Live.Mesh.View
      iex> mag1 = %Swarm.Status{robot: :mag1, state: :lead}
      iex> view = View.new() |> View.update([mag1], "14:00:01", 0) |> View.update([], "14:00:02", 1_000)
      iex> {View.robots(view), View.living(view), Enum.map(view.stages, & &1.line)}
      {[:mag1], [], ["mag1 is heard", "mag1: lead", "mag1 is no longer heard"]}
  """
  @spec update(t(), [Status.t()], clock :: String.t(), at_ms :: integer()) :: t()
  def update(view, statuses, clock, at_ms) do
    present = Map.new(statuses, &{&1.robot, &1})
    gone = view.statuses |> Map.keys() |> Enum.reject(&is_map_key(present, &1)) |> MapSet.new()

    lines =
      for({id, status} <- Enum.sort(present), line <- changes(view, id, status), do: {id, line}) ++
        for id <- Enum.sort(MapSet.difference(gone, view.gone)),
            do: {id, {:heard, "is no longer heard", nil}}

    kept = Map.merge(view.statuses, present, fn _id, before, now -> known(before, now) end)
    order = view.order ++ (kept |> Map.keys() |> Enum.sort() |> Kernel.--(view.order))

    places = Frames.places(for id <- order, do: heard(kept[id], id in gone))
    # What one was that does not answer is not what it is.
    held =
      for {id, %{estop: true} = status} <- Enum.sort(kept),
          id not in gone and status.state != :no_answer,
          do: {id, status.estop_by}

    estop = Scene.estop(view.estop, held, map_size(kept) - MapSet.size(gone), at_ms)
    view = %{view | statuses: kept, order: order, gone: gone, places: places, estop: estop}
    Enum.reduce(lines, view, &tell(&1, &2, clock, at_ms))
  end

  # No robot is led by one that has gone.
  defp heard(status, true), do: %{status | state: :not_heard}
  defp heard(status, false), do: status

  # Of a robot that does not answer, and has no row, only this is new.
  defp known(before, %Status{state: :no_answer}), do: %{before | state: :no_answer}
  defp known(before, now), do: %{now | body: now.body || before.body}

  defp tell({id, {about, line, ends}}, view, clock, at_ms) do
    n = view.told + 1
    line = if String.starts_with?(line, "is "), do: "#{id} #{line}", else: "#{id}: #{line}"
    stage = %{stage: :mesh, about: about, n: n, at_s: at_ms / 1000, clock: clock}
    stage = Map.merge(stage, %{robot: id, line: line, ends: ends})
    %{view | told: n, stages: Enum.take(view.stages ++ [stage], -@most_stages)}
  end

  defp changes(view, id, status) do
    before = unless id in view.gone, do: view.statuses[id]
    heard = if before, do: [], else: [{:heard, "is heard", nil}]
    status = if before, do: known(before, status), else: status

    heard ++
      for {{key, now, none}, {key, was, _none}} <- Enum.zip(facts(status), facts(before)),
          now != was,
          do: if(now, do: {key, now, nil}, else: {key, none, name(key)})
  end

  # What has ended is what was told before.
  defp name(:state), do: nil
  defp name(key), do: key |> to_string() |> String.replace("_", " ")

  # What is worth a line when it changes, as text, and what to say when there is no such thing any more.
  defp facts(nil), do: facts(%Status{robot: nil, state: nil})

  defp facts(status) do
    offline = for {device, {:offline, _reason}} <- status.health, do: "#{device}"

    [
      {:state, status.state && state(status), "does nothing"},
      {:estop, if(status.estop, do: "is held by the emergency stop"),
       "is released from the emergency stop"},
      {:estop_file,
       status.estop_file && "its e-stop file is not as the stop is: #{status.estop_file}",
       "its e-stop file is as the stop is"},
      {:arming, Status.arming(status), "its wheels may turn"},
      {:fault, status.fault && "fault: #{status.fault}", "the fault is gone"},
      {:crashed, status.crashed && "crashed: #{status.crashed}", "begins anew after its crash"},
      {:blocked, status.blocked_by && "blocked by #{status.blocked_by}", "its way is free"},
      {:offline, if(offline != [], do: "offline: #{Enum.join(Enum.sort(offline), ", ")}"),
       "all devices are online"},
      {:network, status.network && "no network: #{status.network}", "the network is back"}
    ]
  end

  defp state(%{state: :no_answer}), do: "does not answer"
  defp state(%{state: state, leader: nil}), do: "#{state}"
  defp state(%{state: state, leader: id, robot: id}), do: "#{state}"
  defp state(%{state: state, leader: leader}), do: "#{state}, leader #{leader}"

  @doc "All robots that were ever heard; the first is always the first, so that its colour stays."
  @spec robots(t()) :: [atom()]
  def robots(view), do: view.order

  @doc "Those that are heard now."
  @spec living(t()) :: [atom()]
  def living(view), do: Enum.reject(robots(view), &(&1 in view.gone))

  @doc "The last status of each that is heard now."
  @spec statuses(t()) :: [Status.t()]
  def statuses(view), do: Enum.map(living(view), &view.statuses[&1])

  @doc "What is drawn; `at_ms` is how long this has been looking."
  @spec scene(t(), non_neg_integer()) :: Scene.t()
  def scene(view, at_ms) do
    robots =
      for id <- robots(view),
          do: robot(view.statuses[id], id in view.gone, Map.fetch!(view.places, id))

    leader = Enum.find(robots, &(&1.alive and &1.leader?))

    %Scene{
      at_ms: at_ms,
      map: nil,
      robots: robots,
      mission: mission(view),
      leader: leader && leader.id,
      epoch: leader && view.statuses[leader.id].epoch,
      formation: leader && view.statuses[leader.id].formation,
      estop: view.estop,
      stages: view.stages
    }
  end

  # What most of those do that are on a mission.
  defp mission(view) do
    names = for %{mission: name} when name != nil <- statuses(view), do: name
    counts = Enum.frequencies(names)
    Enum.max_by(names, &counts[&1], fn -> nil end)
  end

  defp robot(status, gone?, {frame, apart}) do
    shape = Frames.shape(status)

    %{
      id: status.robot,
      pose: status.pose,
      radius: shape.radius,
      corners: shape.corners,
      alive: not gone?,
      state: if(gone?, do: :not_heard, else: shown(status)),
      slot: nil,
      leader?: "#{status.state}" == "lead",
      follows: if(status.leader != status.robot, do: status.leader),
      uncertainty: status.uncertainty,
      says: status.says,
      blocked_by: status.blocked_by,
      arming: arming(status),
      offline: Enum.sort(for({device, {:offline, _reason}} <- status.health, do: device)),
      crashed: status.crashed,
      fault: status.fault,
      lost: status.frame == :lost,
      size_ppm: nil,
      frame: frame,
      apart: apart
    }
  end

  defp arming(%{arming: :disarmed, why: why}), do: {:disarmed, why}
  defp arming(%{arming: {:error, _reason}, why: why}), do: {:line_lost, why}
  defp arming(_status), do: nil

  # What keeps it from moving comes before what it would do.
  defp shown(%{estop: true}), do: :estop
  defp shown(%{arming: :disarmed}), do: "disarmed"
  defp shown(%{arming: {:error, _reason}}), do: "line lost"
  defp shown(%{state: :no_answer}), do: "no answer"
  defp shown(%{state: state}), do: state
end
