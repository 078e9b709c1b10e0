defmodule Missions.Landmark.Group do
  @moduledoc """
  A handful of landmark missions on one floor, without a world: bodies go straight to their slots,
  a scan takes half a second, and messages go over a small radio that delays, loses, duplicates
  and reorders messages, and can be cut into two. Pure except for `:rand`, which ExUnit seeds.
  """
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Percept
  alias Robot.Localiser.Anchors
  alias Robot.Mission.Claim
  alias Swarm.{EStop, Message}
  alias Swarm.Membership.{Heartbeat, Peers}
  alias Swarm.Message.Receiver
  alias Missions.Landmark

  @tick_ms 100
  @beat_ms 200
  @scan_ms 500
  @step 0.05

  defstruct robots: %{},
            air: [],
            now: 0,
            loss: 0.0,
            doubled: 0.0,
            delay_ms: {5, 50},
            cut: [],
            elected: [],
            stages: [],
            digests: %{},
            both_ms: 0,
            worst_both_ms: 0,
            rival_words: []

  @type t :: %__MODULE__{}

  @doc "A group; options are the radio's: `loss`, `doubled`, `delay_ms`, `cut`."
  @spec new(keyword()) :: t()
  def new(options \\ []), do: struct!(__MODULE__, options)

  @doc """
  Puts a robot there and starts it. `share` is the share of the picture that the landmark fills,
  `nil` if unseen.
  """
  @spec join(t(), atom(), {number(), number()}, float() | nil, keyword()) :: t()
  def join(group, id, {x, y}, share, options \\ []) do
    {boot, options} = Keyword.pop(options, :boot, 1)
    {_phase, mission, []} = Landmark.init(id, options)

    robot = %{
      id: id,
      mission: mission,
      receiver: Receiver.new(id),
      pose: Pose.new(x, y),
      share: share,
      boot: boot,
      sequence: 0,
      claim: %{},
      goal: nil,
      goal_ms: 0,
      frame: nil,
      phases: [:idle],
      frozen_ms: nil,
      inbox: []
    }

    group = put_in(group.robots[id], robot)
    event(group, id, {:command, :start})
  end

  @doc "Switches a robot off, with all that it knew."
  @spec kill(t(), atom()) :: t()
  def kill(group, id), do: %{group | robots: Map.delete(group.robots, id)}

  @doc """
  Freezes a robot for so long, as SIGSTOP does: it does nothing, and what others send waits for it.
  Then it hears all that in any order with what it does itself: its heartbeats may come before its
  mission's first tick. `rival_words` collects who said that it leads while another did.
  """
  @spec freeze(t(), atom(), pos_integer()) :: t()
  def freeze(group, id, ms), do: put_in(group.robots[id].frozen_ms, group.now + ms)

  defp frozen?(group, id) do
    case group.robots[id] do
      %{frozen_ms: until_ms} when until_ms != nil -> until_ms > group.now
      _awake -> false
    end
  end

  defp thaw(id, group) do
    case group.robots[id] do
      %{frozen_ms: until_ms, inbox: inbox} when until_ms != nil and until_ms <= group.now ->
        group = put_in(group.robots[id].frozen_ms, nil)
        group = put_in(group.robots[id].inbox, [])

        {before, later} =
          inbox |> Enum.reverse() |> Enum.split(:rand.uniform(length(inbox) + 1) - 1)

        hear = fn {from, message}, group -> hear(group, id, from, message) end
        group = Enum.reduce(before, group, hear)
        group = if :rand.uniform(2) == 1, do: beat(group, id), else: group
        Enum.reduce(later, group, hear)

      _awake ->
        group
    end
  end

  @doc "Sets how much of a robot's picture the landmark fills from now on; `:dark`: there are no pictures."
  @spec show(t(), atom(), float() | nil | :dark) :: t()
  def show(group, id, share), do: put_in(group.robots[id].share, share)

  @doc """
  Cuts the radio between the members of different sets, or single links `{:link, a, b}` and
  directions `{:way, from, to}`; `[]` mends it.
  """
  @spec cut(t(), [[atom()] | {:link | :way, atom(), atom()}]) :: t()
  def cut(group, sets), do: %{group | cut: sets}

  @doc "The groups of robots that can reach each other, directly or by way of others."
  @spec parts(t()) :: [[atom()]]
  def parts(group), do: parts(group, ids(group))

  defp parts(_group, []), do: []

  defp parts(group, [first | _] = ids) do
    there = reach(ids, [first], &connected?(group, &1, &2))
    back = reach(ids, [first], &connected?(group, &2, &1))
    part = Enum.filter(ids, &(&1 in there and &1 in back))
    [part | parts(group, ids -- part)]
  end

  defp reach(ids, found, way?) do
    more = for b <- ids -- found, Enum.any?(found, &way?.(&1, b)), do: b
    if more == [], do: found, else: reach(ids, found ++ more, way?)
  end

  @doc "Runs for so many seconds."
  @spec run(t(), number()) :: t()
  def run(group, seconds), do: Enum.reduce(1..round(seconds * 10), group, fn _, g -> tick(g) end)

  @doc "Runs until a condition holds, at most so many seconds; returns whether it held."
  @spec until(t(), number(), (t() -> boolean())) :: {boolean(), t()}
  def until(group, seconds, holds?) do
    Enum.reduce_while(1..round(seconds * 10), {false, group}, fn _, {_, group} ->
      group = tick(group)
      if holds?.(group), do: {:halt, {true, group}}, else: {:cont, {false, group}}
    end)
  end

  @doc "Gives one robot one event, as if it happened now."
  @spec event(t(), atom(), term()) :: t()
  def event(group, id, event) do
    robot = group.robots[id]
    {phase, mission, effects} = Landmark.handle(event, robot.mission)
    group = note_digest(group, mission.round)
    phases = if hd(robot.phases) == phase, do: robot.phases, else: [phase | robot.phases]
    group = put_in(group.robots[id], %{robot | mission: mission, phases: phases})
    Enum.reduce(effects, group, &carry_out(&1, id, &2))
  end

  # What was committed under each round's id.
  defp note_digest(group, %{phase: :committed, id: id, digest: digest}) do
    all = Map.update(group.digests, id, MapSet.new([digest]), &MapSet.put(&1, digest))
    %{group | digests: all}
  end

  defp note_digest(group, _round), do: group

  @doc "The current percept of a robot."
  @spec percept(t(), atom()) :: Percept.t()
  def percept(group, id) do
    robot = group.robots[id]

    %Percept{
      robot: id,
      at_ms: group.now,
      profile: Profile.magellan(),
      pose: robot.pose,
      uncertainty: %{
        radius: 0.05,
        position: 0.02,
        spread: {0.02, 0.02, 0.0},
        heading: 0.01,
        frame: robot.frame,
        frame_no: 0,
        start: {0.0, 0.0},
        drift: {0.0, 0.0, 0.0},
        slip: 0.0
      },
      odometry: %Odometry{pose: robot.pose, twist: Twist.zero()},
      peers: Peers.percepts(robot.receiver.peers, group.now),
      detections: detections(group, robot)
    }
  end

  defp detections(_group, %{share: :dark}), do: nil

  defp detections(group, robot),
    do: %Vision.Detections{at_ms: group.now, blobs: blobs(robot.share), pose: robot.pose}

  defp blobs(nil), do: []

  defp blobs(share) do
    [
      %Vision.Blob{
        colour: "YellowLandmark",
        area: round(share * 76_800),
        share: share,
        x: 159.5,
        y: 119.5,
        left: 150,
        right: 169,
        top: 60,
        bottom: 180,
        width: 320,
        height: 240,
        distance: 1.7
      }
    ]
  end

  @doc "The phases of all robots, by name."
  @spec phases(t()) :: %{atom() => atom()}
  def phases(group), do: Map.new(group.robots, fn {id, robot} -> {id, robot.mission.phase} end)

  @doc "The leader of each robot, as it believes."
  @spec leaders(t()) :: %{atom() => atom() | nil}
  def leaders(group), do: Map.new(group.robots, fn {id, robot} -> {id, robot.mission.leader} end)

  @doc "Whether one of these leads and all others follow it, in one epoch."
  @spec one?(t(), [atom()]) :: boolean()
  def one?(group, ids) do
    missions = for id <- ids, do: group.robots[id].mission

    match?([_], Enum.uniq(for m <- missions, do: {m.leader, m.epoch})) and
      hd(missions).leader in ids and
      Enum.all?(missions, &(&1.phase == if(&1.me == &1.leader, do: :lead, else: :follow)))
  end

  defp tick(group) do
    group = deliver(%{group | now: group.now + @tick_ms})
    group = group |> ids() |> Enum.reduce(group, &thaw/2)
    group |> ids() |> Enum.shuffle() |> Enum.reduce(group, &think/2) |> watch()
  end

  # Sorted, because a map's order changes from one start of the VM to the next, and the random
  # draws with it.
  defp ids(group), do: group.robots |> Map.keys() |> Enum.sort()

  defp think(id, group), do: if(frozen?(group, id), do: group, else: awake(id, group))

  defp awake(id, group) do
    group = group |> finish(id) |> event(id, {:tick, percept(group, id)})
    group = forward(group, id, Receiver.forward(group.robots[id].receiver, group.now))
    if rem(group.now, @beat_ms) == 0, do: beat(group, id), else: group
  end

  # Moves bodies and ends scans, as behaviours would do.
  defp finish(group, id) do
    case group.robots[id] do
      %{goal: {{:search, _} = tag, _}, goal_ms: since} = robot
      when group.now - since >= @scan_ms ->
        group = put_in(group.robots[id].goal, {:over, tag})
        event(group, id, {:outcome, tag, if(is_number(robot.share), do: 1, else: 0)})

      %{goal: {_tag, {Robot.Behaviour.Follow, options}}, pose: pose} = robot ->
        put_in(group.robots[id], %{robot | pose: toward(pose, options[:target])})

      _standing ->
        group
    end
  end

  defp toward(pose, target) do
    way = Pose.distance(pose, target)
    part = if way > @step, do: @step / way, else: 1.0
    x = pose.x + part * (target.x - pose.x)
    Pose.new(x, pose.y + part * (target.y - pose.y), pose.heading)
  end

  defp beat(group, id) do
    robot = group.robots[id]
    sender = {robot.boot, robot.sequence + 1}
    heard = Peers.heard(robot.receiver.peers, group.now)
    # As `Swarm.Comms.OwnHeartbeat` does.
    claim = Claim.timely(Landmark, robot.claim, group.now - robot.mission.now_ms)
    beat = Heartbeat.new(sender, percept(group, id), {Landmark, claim}, heard, EStop.State.new())
    group = put_in(group.robots[id].sequence, robot.sequence + 1)
    group = if beat.phase == :lead, do: note_rivals(group, id), else: group
    carry_out({:send, :all, Message.new(id, :heartbeat, beat)}, id, group)
  end

  defp note_rivals(group, id) do
    rivals =
      for {other, %{claim: claim, mission: %{now_ms: ticked_ms}}} <- group.robots,
          other != id,
          not frozen?(group, other),
          match?(%{phase: :lead}, Claim.timely(Landmark, claim, group.now - ticked_ms)),
          Enum.any?(parts(group), &(id in &1 and other in &1)),
          do: {group.now, id, other}

    %{group | rival_words: rivals ++ group.rival_words}
  end

  defp carry_out({:send, to, message}, id, group) do
    to = if to == :all, do: ids(group) -- [id], else: List.wrap(to)
    Enum.reduce(to, group, &send_one(&1, id, message, &2))
  end

  defp carry_out({:claim, to, %{anchor: anchor}}, id, group),
    do: carry_out({:send, to, Missions.Landmark.Beat.pass_on(id, anchor)}, id, group)

  defp carry_out({:claim, claim}, id, group), do: put_in(group.robots[id].claim, claim)

  defp carry_out({:goal, tag, goal}, id, group) do
    case group.robots[id] do
      %{goal: {:over, ^tag}} ->
        group

      %{goal: {^tag, _}} ->
        put_in(group.robots[id].goal, {tag, goal})

      robot ->
        put_in(group.robots[id], %{robot | goal: {tag, goal}, goal_ms: group.now})
    end
  end

  defp carry_out({:stage, :elected, facts}, id, group),
    do: %{group | elected: [{facts.epoch, id} | group.elected]}

  defp carry_out({:stage, stage, _facts}, id, group),
    do: %{group | stages: [{stage, id, group.now} | group.stages]}

  defp carry_out({:anchors, %Anchors{frame: frame}}, id, group) when frame != nil,
    do: put_in(group.robots[id].frame, frame.key)

  defp carry_out(_look_or_anchors, _id, group), do: group

  defp send_one(to, from, message, group) do
    copies = if :rand.uniform() < group.doubled, do: 2, else: 1
    {least, most} = group.delay_ms

    sent =
      for _copy <- 1..copies,
          connected?(group, from, to),
          :rand.uniform() >= group.loss,
          do: {group.now + least + :rand.uniform(most - least + 1) - 1, to, from, message}

    %{group | air: sent ++ group.air}
  end

  defp connected?(%{cut: []}, _a, _b), do: true

  defp connected?(%{cut: cut}, a, b) do
    {links, sets} = Enum.split_with(cut, &is_tuple/1)

    (sets == [] or Enum.any?(sets, &(a in &1 and b in &1))) and
      Enum.all?(links, &(&1 not in [{:link, a, b}, {:link, b, a}, {:way, a, b}]))
  end

  defp deliver(group) do
    {due, air} = Enum.split_with(group.air, fn {at, _, _, _} -> at <= group.now end)

    due
    |> Enum.sort_by(fn {at, _, _, _} -> at end)
    |> Enum.reduce(%{group | air: air}, fn {_at, to, from, message}, group ->
      cond do
        not (is_map_key(group.robots, to) and is_map_key(group.robots, from)) ->
          group

        frozen?(group, to) ->
          update_in(group.robots[to].inbox, &[{from, message} | &1])

        true ->
          hear(group, to, from, message)
      end
    end)
  end

  @doc "Lets a robot hear a message now."
  @spec hear(t(), atom(), atom(), Message.t()) :: t()
  def hear(group, to, from, message) do
    {:ok, ^message} = checked = Message.check(message)
    ^from = message.from
    {heard, receiver} = Receiver.take(group.robots[to].receiver, checked, group.now)
    take(put_in(group.robots[to].receiver, receiver), to, heard)
  end

  defp take(group, to, {:message, message}) do
    forwarded = Receiver.forward(group.robots[to].receiver, message, group.now)
    group |> forward(to, forwarded) |> event(to, {:message, message})
  end

  defp take(group, _to, _heartbeat_or_nothing), do: group

  defp forward(group, id, {receiver, sendings}) do
    group = put_in(group.robots[id].receiver, receiver)
    Enum.reduce(sendings, group, &carry_out(&1, id, &2))
  end

  # How long two robots lead in one connected group.
  defp watch(group) do
    leading =
      for {id, %{mission: %{phase: :lead}}} <- group.robots, not frozen?(group, id), do: id

    both? =
      length(leading) > 1 and
        Enum.any?(parts(group), fn part -> Enum.count(leading, &(&1 in part)) > 1 end)

    both = if both?, do: group.both_ms + @tick_ms, else: 0
    %{group | both_ms: both, worst_both_ms: max(group.worst_both_ms, both)}
  end
end
