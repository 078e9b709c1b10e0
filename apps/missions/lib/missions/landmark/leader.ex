defmodule Missions.Landmark.Leader do
  @moduledoc """
  What the leader does besides tracking the landmark: it announces where it is supposed to be (the
  reference), maintains the order of the slots when robots leave and join, and judges whether the
  shape is formed. Pure.
  """
  alias Robot.Behaviour
  alias Robot.Localiser.Anchors
  alias Swarm.{Formation, Message}
  alias Swarm.Formation.{Assignment, Chain, Reference}
  alias Swarm.Membership.{NameSet, Peers}
  alias Missions.Landmark
  alias Missions.Landmark.{LandmarkTrack, Merge, Rounds, Shape}

  # Nearer than 1.4 m the landmark's foot leaves the picture, and then its size is unknown.
  @near 1.5
  @far 1.9
  # How far from its ring around the landmark a leader may stand.
  @ring_slack 0.15
  # A landmark that was measured at most this long ago is where it was reported.
  @still_ms 400
  # A shape is formed when it has been right for this long, and no longer when it was wrong for
  # this long.
  @formed_ms 1_000
  @unformed_ms 500
  # The landmark is lost if it was not seen for this long; a little later the leader looks around.
  @lost_ms 3_000
  @scan_ms 5_000
  @unheard_ms 1_500
  # By then all that took part in the round have reported that they follow; later ones are new.
  @settled_ms 1_000
  # No robot is farther away than this, in any unit.
  @lost 999_999_999
  # For this long a new leader sends its place to all, not only to its child.
  @fresh_ms 500

  defstruct sequence: 0,
            good_ms: nil,
            bad_ms: nil,
            formed?: false,
            lost?: false,
            heard_ms: nil,
            shape: %Shape{}

  @typedoc """
  `sequence` numbers the anchors; the shape has been right since `good_ms`, or wrong since
  `bad_ms`; `heard_ms` is when somebody was last known to hear this leader.
  """
  @type t :: %__MODULE__{
          sequence: non_neg_integer(),
          good_ms: integer() | nil,
          bad_ms: integer() | nil,
          formed?: boolean(),
          lost?: boolean(),
          heard_ms: integer() | nil,
          shape: Shape.t()
        }

  @doc "The state of a robot that does not lead yet."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "Takes the lead with the order of the round's record."
  @spec begin(Landmark.State.t()) :: Landmark.State.t()
  def begin(mission) do
    %{
      mission
      | lead: %__MODULE__{sequence: mission.lead.sequence, heard_ms: mission.now_ms},
        scan: nil,
        anchor: nil
    }
  end

  @doc """
  Takes a new shape, which everyone learns from the anchor; `:cost` assigns the slots again.
  """
  @spec reshape(Landmark.State.t()) :: Landmark.State.t()
  def reshape(mission) do
    lead = %{mission.lead | formed?: false, good_ms: nil, bad_ms: nil, shape: Shape.new()}
    %{mission | lead: lead}
  end

  @doc """
  Whether a leader stops leading: it gives way to a later one, or nobody has heard it for 1.5 s
  though it is not alone. Under the policy `:majority` more than half of the fleet must hear it.
  """
  @spec deposed?(Landmark.State.t()) :: boolean()
  def deposed?(mission) do
    Merge.yields?(mission) or
      ((mission.order != [] or mission.of > 0) and
         mission.now_ms - mission.lead.heard_ms >= @unheard_ms)
  end

  @doc "One tick of leading."
  @spec act(Landmark.State.t()) :: {Landmark.State.t(), [tuple()]}
  def act(mission) do
    mission = hear(mission)
    if mission.percept.pose, do: lead(mission), else: blind(mission)
  end

  # A leader that does not know where it is cannot tell others where to stand; they soon stop.
  defp blind(mission),
    do: {%{mission | anchor: nil}, [{:goal, :stand, {Behaviour.Stop, []}}, {:look, 0.0}]}

  defp lead(mission) do
    mission = mission |> muster() |> shape() |> tell()
    {mission, formed} = judge(mission)
    {mission, lost} = miss(mission)
    told = told(mission)

    place =
      if told == [],
        do: [],
        else: [{:send, told, Message.new(mission.me, :place, mission.anchor)}]

    {mission, formed ++ lost ++ place ++ [goal(mission), {:look, 0.0}, {:anchors, %Anchors{}}]}
  end

  # When enough followers for a majority last reported that they hear this leader.
  defp hear(%{of: of} = mission) when of > 0 do
    told =
      for {_id, %{at_ms: at_ms, beat: %{leader: leader, heard: heard}}} <- mission.percept.peers,
          leader == mission.me and NameSet.member?(heard, mission.me),
          do: at_ms

    heard_ms =
      case div(of, 2) do
        0 -> mission.now_ms
        others -> told |> Enum.sort(:desc) |> Enum.at(others - 1, mission.lead.heard_ms)
      end

    put_in(mission.lead.heard_ms, max(heard_ms, mission.lead.heard_ms))
  end

  # If it is alone, nobody can hear it, and a robot that comes needs time to hear it.
  defp hear(mission) do
    heard? =
      mission.percept.peers
      |> Peers.taking_part(mission.now_ms)
      |> Enum.any?(fn {_id, beat} -> NameSet.member?(beat.heard, mission.me) end)

    if heard? or mission.order == [],
      do: put_in(mission.lead.heard_ms, mission.now_ms),
      else: mission
  end

  # The child passes it on; but at first all robots stand and wait for it.
  defp told(mission) do
    if mission.now_ms - mission.since_ms < @fresh_ms,
      do: mission.order,
      else: Enum.take(mission.order, 1)
  end

  # Robots that are gone leave their slots and those behind move up (R53 with healing); new ones
  # join the tail.
  defp muster(mission) do
    view = List.delete(Rounds.view(mission), mission.me)
    kept = Chain.heal(mission.order, view)

    came =
      if mission.now_ms - mission.since_ms >= @settled_ms,
        do: (view -- kept) -- Merge.theirs(view, mission),
        else: []

    %{mission | order: kept ++ came}
  end

  # If the shape has changed, `:cost` assigns its slots again.
  defp shape(%{lead: lead} = mission) do
    shape = Shape.update(lead.shape, mission, landmark_distance(mission))
    new? = {shape.formation, shape.room} != {lead.shape.formation, lead.shape.room}
    mission = %{mission | lead: %{lead | shape: shape}}
    dealt? = lead.shape.room == nil and mission.now_ms == mission.since_ms and all_free?(mission)
    if new? and not dealt? and mission.assign == :cost, do: deal(mission), else: mission
  end

  # Then the round's record has assigned them; it does not know where there is no room.
  defp all_free?(%{order: order, lead: %{shape: %{room: {size, places}}}}) do
    count = length(order)
    size == count + 1 and Enum.sort(places) == Enum.to_list(1..count//1)
  end

  defp landmark_distance(%{sight: %{place: place}, percept: percept}) when place != nil,
    do: Hal.Pose.distance(percept.pose, place)

  defp landmark_distance(_mission), do: @near

  # Assigns the slots by squared distance from where the robots say they are.
  defp deal(mission) do
    beats = Peers.taking_part(mission.percept.peers, mission.now_ms)
    followers = for id <- mission.order, {x, y, _heading} = beats[id].pose, do: {id, {x, y}}
    {x, y, _heading} = Landmark.State.millimetres(mission.percept.pose)
    {size, places} = mission.lead.shape.room

    slots =
      Rounds.slots(
        mission.lead.shape.formation,
        mission.percept.pose,
        size,
        landmark_distance(mission)
      )

    used = for place <- places, do: Enum.at(slots, place - 1)
    %{mission | order: Assignment.order(:cost, followers, {x, y}, used)}
  end

  defp tell(%{percept: percept, lead: lead} = mission) do
    sequence = lead.sequence + 1
    place = mission.sight && mission.sight.place

    anchor = %Reference{
      leader: mission.me,
      epoch: mission.epoch,
      sequence: sequence,
      pose: Landmark.State.millimetres(percept.pose),
      twist: twist(percept),
      sd: sd(percept.uncertainty),
      start_sd: start_sd(percept.uncertainty),
      drift: drift(percept.uncertainty),
      slip: min(ceil(percept.uncertainty.slip * 1000), @lost),
      frame: percept.uncertainty.frame_no,
      base: percept.uncertainty.frame,
      formation: lead.shape.formation,
      asked: mission.formation,
      asked_no: mission.asked_no,
      order: mission.order,
      size: elem(lead.shape.room, 0),
      places: elem(lead.shape.room, 1),
      trail: Shape.trail(lead.shape, mission),
      of: mission.of,
      landmark: place && point(place),
      still: LandmarkTrack.still?(mission.sight, mission.now_ms, @still_ms)
    }

    %{mission | anchor: anchor, lead: %{lead | sequence: sequence}}
  end

  defp sd(%{position: position, heading: heading}),
    do: {min(round(position * 1000), @lost), min(round(heading * 1000), @lost)}

  defp start_sd(%{start: {position, heading}}),
    do: sd(%{position: :math.sqrt(position), heading: :math.sqrt(heading)})

  defp drift(%{drift: {way, turn, turned}}),
    do: {millionths(way), millionths(turn), min(round(turned * 1000), @lost)}

  defp millionths(variance), do: min(round(variance * 1.0e6), @lost)

  # A crawl is reported as standing still, so that no slot trembles.
  defp twist(%{odometry: %{twist: %{linear: linear, turn: turn}}}) do
    if abs(linear) < 0.02 and abs(turn) < 0.02,
      do: {0, 0},
      else: {round(linear * 1000), round(turn * 1000)}
  end

  defp point({x, y}), do: {round(x * 1000), round(y * 1000)}

  # All followers are in place, and the leader is still in front of the landmark, for a second.
  defp judge(mission) do
    good? =
      Landmark.State.sees?(mission) and Landmark.State.slow?(mission.percept, 0.05) and
        Enum.all?(mission.order, &in_place?(mission, &1))

    now = mission.now_ms
    lead = mission.lead

    lead =
      if good?,
        do: %{lead | good_ms: lead.good_ms || now, bad_ms: nil},
        else: %{lead | bad_ms: lead.bad_ms || now, good_ms: nil}

    cond do
      not lead.formed? and good? and now - lead.good_ms >= @formed_ms ->
        {%{mission | lead: %{lead | formed?: true}},
         [{:stage, :formed, %{epoch: mission.epoch, size_ppm: mission.sight.size_ppm}}]}

      lead.formed? and not good? and now - lead.bad_ms >= @unformed_ms ->
        {%{mission | lead: %{lead | formed?: false}}, []}

      true ->
        {%{mission | lead: lead}, []}
    end
  end

  defp in_place?(mission, id) do
    case mission.percept.peers do
      %{^id => %{beat: beat, at_ms: at_ms}} ->
        beat.in_place and beat.epoch == mission.epoch and mission.now_ms - at_ms < 1_000

      _unknown ->
        false
    end
  end

  defp miss(mission) do
    seen_ms = (mission.sight && mission.sight.at_ms) || mission.since_ms
    lost? = mission.now_ms - max(seen_ms, mission.since_ms) >= @lost_ms

    stage =
      if lost? and not mission.lead.lost?,
        do: [{:stage, :lost, %{epoch: mission.epoch}}],
        else: []

    {put_in(mission.lead.lost?, lost?), stage}
  end

  # A leader that has not seen the landmark for long looks all around for it. A new leader may
  # have seen it with its camera turned aside, and look ahead now: it turns to where the landmark
  # was.
  defp goal(mission) do
    if LandmarkTrack.fresh?(mission.sight, mission.now_ms, @scan_ms) or
         mission.now_ms - mission.since_ms < @scan_ms do
      {near, far} = range(mission)
      place = mission.sight && mission.sight.place
      options = [colour: mission.colour, near: near, far: far, place: place]
      {:goal, {:track, mission.epoch}, {Behaviour.TrackBlob, options}}
    else
      turn = div(mission.now_ms, 20_000)
      {:goal, {:seek, mission.epoch, turn}, {Behaviour.FindBlob, [colour: mission.colour]}}
    end
  end

  defp range(%{formation: {:circle, _d} = formation, order: order}) do
    ring = Formation.ring(formation, length(order) + 1)
    {ring - @ring_slack, ring + @ring_slack}
  end

  defp range(_mission), do: {@near, @far}
end
