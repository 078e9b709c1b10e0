defmodule Robot.Hall do
  @moduledoc false
  # A fleet on a plane for tests: discs with the lag and the accelerations of their wheels, sonars that see
  # discs and walls, poses told 5 times a second, late and inexact. Everybody runs Controller and Reflex.
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Body, Percept}
  alias Robot.Control.Controller
  alias Robot.Safety.Reflex
  alias Robot.Behaviour.Follow

  @lag_s 0.1
  @delay_ms 200
  @noise 0.05
  @bias 0.04

  @doc """
  Runs a fleet of n, leader included, from seeded random starts into a shape behind (or round)
  the holding leader. Options: `shape`, `assign` (:chain or :cost), `limit_s`, `kinds`, `dead` (how many wrecks).
  """
  def form(n, seed, options),
    do: n |> start(seed, options) |> run(Keyword.get(options, :limit_s, 180) * 1000)

  @doc "The fleet at its start."
  def start(n, seed, options) do
    :rand.seed(:exsss, {seed, n, 7})
    defaults = [shape: :column, assign: :cost, limit_s: 180, kinds: :mixed, dead: 0, spacing: 1.0]
    build(n, Keyword.merge(defaults, options))
  end

  defp build(n, options) do
    spacing = options[:spacing]
    ring = max(1.2, spacing / (2 * :math.sin(:math.pi() / max(n, 2))))
    half_w = max(8.0, n + 2.0)
    half_h = max(6.0, n / 2 + 2.0)
    heading = Enum.random([0.0, 0.3, 1.2, -0.4, 3.0])
    heading = if n > 10, do: 0.0, else: heading
    leader_pose = Pose.new(0.0, 0.0, heading)
    distance = if options[:shape] == :circle, do: ring, else: 1.3
    landmark = Pose.place(leader_pose, {distance, 0.0})
    # The shape is laid about the middle of the hall, so it fits.
    ids = for k <- 1..n, do: :"r#{k}"
    profiles = Map.new(ids, &{&1, profile(options[:kinds])})
    wrecks = for k <- 1..options[:dead]//1, do: :"d#{k}"

    taken = [{landmark, 0.2}, {{0.0, 0.0}, 0.3}]

    {poses, _} =
      Enum.map_reduce(tl(ids) ++ wrecks, taken, fn _id, taken ->
        place = free(taken, min(half_w, 8.0 + n / 6) - 0.6, min(half_h, 6.0 + n / 6) - 0.6)
        {place, [{place, 0.3} | taken]}
      end)

    poses = Map.new(Enum.zip(tl(ids) ++ wrecks, poses))
    followers = tl(ids)

    slots =
      slots(options[:shape], n, spacing, ring)
      |> Enum.map(fn {p, h} -> Pose.compose(leader_pose, Pose.new(elem(p, 0), elem(p, 1), h)) end)

    assigned = assign(options[:assign], followers, poses, slots, leader_pose)

    robots =
      for id <- ids, into: %{} do
        profile = profiles[id]
        angle = 2 * :math.pi() * :rand.uniform()

        pose =
          case poses[id] do
            nil -> leader_pose
            {x, y} -> Pose.new(x, y, angle)
          end

        b = 2 * :math.pi() * :rand.uniform()
        controller = Controller.new(profile: profile)

        {id,
         %{
           id: id,
           profile: profile,
           pose: pose,
           twist: Twist.zero(),
           next: pose,
           reflex: Reflex.new(profile),
           controller: controller,
           slot: assigned[id],
           velocity: {0.0, 0.0},
           bias: {@bias * :math.cos(b), @bias * :math.sin(b)},
           phase: :rand.uniform(4) - 1,
           mail: [],
           peers: %{},
           limits: [],
           by: nil
         }}
      end

    dead = for id <- wrecks, do: {poses[id], 0.25, id}

    %{
      at_ms: 0,
      robots: robots,
      leader: hd(ids),
      landmark: landmark,
      half: {half_w, half_h},
      dead: dead,
      contacts: 0,
      touching: MapSet.new(),
      min_gap: 100.0,
      formed_ms: nil,
      good_ms: nil,
      tick_us: [],
      events: []
    }
  end

  defp profile(:mixed), do: Enum.random([Profile.magellan(), Profile.atrv_mini()])
  defp profile(:mag), do: Profile.magellan()
  defp profile(:min), do: Profile.atrv_mini()

  defp free(taken, w, h) do
    place = {w * (2 * :rand.uniform() - 1), h * (2 * :rand.uniform() - 1)}

    if Enum.all?(taken, fn {t, _} -> Pose.distance(t, place) > 1.0 end),
      do: place,
      else: free(taken, w, h)
  end

  defp slots(:column, n, d, _), do: for(k <- 1..(n - 1)//1, do: {{-k * d, 0.0}, 0.0})

  defp slots(:line, n, d, _) do
    for k <- 1..(n - 1)//1, do: {{0.0, div(k + 1, 2) * if(rem(k, 2) == 1, do: d, else: -d)}, 0.0}
  end

  defp slots(:wedge, n, d, _) do
    a = d * :math.cos(:math.pi() / 4)

    for k <- 1..(n - 1)//1,
        do: {{-div(k + 1, 2) * a, div(k + 1, 2) * if(rem(k, 2) == 1, do: a, else: -a)}, 0.0}
  end

  defp slots(:triangle, n, d, _) do
    for k <- 1..(n - 1)//1 do
      r = trunc((:math.sqrt(8 * k + 1) - 1) / 2)
      c = k - div(r * (r + 1), 2)
      {{-r * d * :math.sqrt(3) / 2, (r / 2 - c) * d}, 0.0}
    end
  end

  defp slots(:circle, n, _d, ring) do
    for k <- 1..(n - 1)//1 do
      a = :math.pi() + 2 * :math.pi() * k / n
      {{ring + ring * :math.cos(a), ring * :math.sin(a)}, a + :math.pi()}
    end
  end

  defp assign(:chain, ids, poses, slots, leader) do
    ids
    |> Enum.sort_by(&Pose.distance(poses[&1], leader))
    |> Enum.zip(Enum.sort_by(slots, &Pose.distance(&1, leader)))
    |> Map.new()
  end

  defp assign(:cost, ids, poses, slots, leader),
    do: swap(assign(:chain, ids, poses, slots, leader), poses, ids)

  # Two swap as long as that lowers the sum of squares.
  defp swap(map, poses, ids) do
    better =
      for a <- ids, b <- ids, a < b, reduce: map do
        map ->
          cost = fn i, j -> :math.pow(Pose.distance(poses[i], map[j]), 2) end

          if cost.(a, b) + cost.(b, a) < cost.(a, a) + cost.(b, b) - 1.0e-9,
            do: %{map | a => map[b], b => map[a]},
            else: map
      end

    if better == map, do: map, else: swap(better, poses, ids)
  end

  @doc """
  Forms a column, then the leader drives on for some seconds at this speed and turn rate;
  gives the mean and greatest error on the way after the first 5 s, and the report of standing again.
  """
  def travel(n, seed, seconds, twist) do
    %{hall: hall} = form(n, seed, shape: :column)

    offsets =
      Map.new(hall.robots, fn {id, r} ->
        {id, r.slot && Pose.relative(hall.robots[hall.leader].pose, r.slot)}
      end)

    hall = %{hall | half: {60.0, 60.0}, landmark: {50.0, 50.0}}

    {hall, errors} =
      Enum.reduce(1..(20 * seconds), {hall, []}, fn k, {hall, errors} ->
        hall = hall |> lead(twist, offsets) |> step()
        now = for {_, r} <- hall.robots, r.slot, do: Pose.distance(est(r), r.slot)
        {hall, if(k > 100, do: now ++ errors, else: errors)}
      end)

    stop = lead(hall, Twist.zero(), offsets)
    report = run(%{stop | formed_ms: nil, good_ms: nil}, hall.at_ms + 60_000)

    {Enum.sum(errors) / max(length(errors), 1), Enum.max(errors, fn -> 0.0 end),
     report.formed_s && report.formed_s - hall.at_ms / 1000, report}
  end

  # The leader's wheels obey at once; slots move rigidly with it.
  defp lead(hall, twist, offsets) do
    robots =
      Map.new(hall.robots, fn {id, r} ->
        if r.slot do
          slot = Pose.compose(hall.robots[hall.leader].pose, offsets[id])
          lead = hall.robots[hall.leader].pose
          c = twist.linear * :math.cos(lead.heading)
          s = twist.linear * :math.sin(lead.heading)
          velocity = {c - twist.turn * (slot.y - lead.y), s + twist.turn * (slot.x - lead.x)}
          {id, %{r | slot: slot, velocity: velocity}}
        else
          controller =
            Controller.goal(
              r.controller,
              {:drive, twist},
              {Robot.Behaviour.Move, linear: twist.linear, turn: twist.turn}
            )

          {id, %{r | controller: controller}}
        end
      end)

    %{hall | robots: robots}
  end

  defp run(hall, limit_ms) do
    cond do
      hall.formed_ms -> report(hall)
      hall.at_ms >= limit_ms -> report(hall)
      true -> hall |> step() |> run(limit_ms)
    end
  end

  @doc "One step of 50 ms; every second one thinks."
  def step(hall) do
    hall = if rem(hall.at_ms, 100) == 0, do: hall |> radio() |> think(), else: hall
    hall |> drive() |> judge() |> Map.update!(:at_ms, &(&1 + 50))
  end

  defp radio(hall) do
    senders = for {_, r} <- hall.robots, rem(div(hall.at_ms, 50) + r.phase, 4) in [0, 1], do: r

    messages =
      for r <- senders do
        {x, y} = est(r)
        pose = Pose.new(x + noise(), y + noise(), r.pose.heading)
        mode = if r.id == hall.leader, do: :holding, else: :moving

        {hall.at_ms + @delay_ms, r.id,
         %{
           pose: pose,
           twist: r.twist,
           radius: r.profile.radius,
           at_ms: hall.at_ms + @delay_ms,
           mode: mode
         }}
      end

    dead =
      for {{x, y}, radius, id} <- hall.dead,
          do:
            {id,
             %{pose: Pose.new(x, y), twist: Twist.zero(), radius: radius, at_ms: 0, mode: :dead}}

    robots =
      Map.new(hall.robots, fn {id, r} ->
        {due, mail} = Enum.split_with(r.mail ++ messages, fn {at, _, _} -> at <= hall.at_ms end)
        peers = for {_, from, peer} <- due, from != id, into: r.peers, do: {from, peer}
        {id, %{r | mail: mail, peers: Map.merge(peers, Map.new(dead))}}
      end)

    %{hall | robots: robots}
  end

  defp est(r), do: {r.pose.x + elem(r.bias, 0), r.pose.y + elem(r.bias, 1)}
  defp noise, do: @noise * (2 * :rand.uniform() - 1)

  defp think(hall) do
    discs = [{elem(hall.landmark, 0), elem(hall.landmark, 1), 0.15}]

    {robots, us} =
      Enum.map_reduce(hall.robots, 0, fn {id, r}, us ->
        sonar = sonar(r, hall)
        {x, y} = est(r)

        percept = %Percept{
          robot: id,
          at_ms: hall.at_ms,
          profile: r.profile,
          pose: Pose.new(x + 0.1 * noise(), y + 0.1 * noise(), r.pose.heading),
          odometry: %Odometry{pose: r.pose, twist: r.twist},
          sonar: sonar,
          peers: r.peers,
          driving: %{twist: r.twist, limits: r.limits}
        }

        controller =
          if r.slot,
            do:
              Controller.goal(
                r.controller,
                :slot,
                {Follow, target: r.slot, velocity: r.velocity, discs: discs}
              ),
            else: r.controller

        {took, {wish, _, controller}} = :timer.tc(fn -> Controller.tick(controller, percept) end)

        reflex =
          r.reflex
          |> Reflex.sense({:sonar, sonar}, hall.at_ms)
          |> elem(0)
          |> Reflex.wish(wish.twist, hall.at_ms)

        {{id, %{r | controller: controller, reflex: reflex, by: wish}}, us + took}
      end)

    %{hall | robots: Map.new(robots), tick_us: [us / map_size(hall.robots) | hall.tick_us]}
  end

  defp sonar(r, hall) do
    others = for {id, o} <- hall.robots, id != r.id, do: {o.pose.x, o.pose.y, o.profile.radius}
    dead = for {{x, y}, radius, _} <- hall.dead, do: {x, y, radius}
    all = [{elem(hall.landmark, 0), elem(hall.landmark, 1), 0.15} | others ++ dead]
    near = Enum.filter(all, fn {x, y, _} -> Pose.distance(r.pose, {x, y}) < 3.0 end)

    for s <- r.profile.sonars do
      p = Pose.compose(r.pose, s)

      range =
        for a <- [-0.2, 0.0, 0.2],
            reduce: 5.1,
            do: (m -> min(m, ray(p.x, p.y, p.heading + a, near, hall.half)))

      if range < 5.0,
        do: max(r.profile.sonar_min, range + 0.01 * (2 * :rand.uniform() - 1)),
        else: 5.1
    end
  end

  defp ray(x, y, a, discs, {w, h}) do
    c = :math.cos(a)
    s = :math.sin(a)
    wall_x = if abs(c) > 1.0e-6, do: (if(c > 0, do: w, else: -w) - x) / c, else: 9.0
    wall_y = if abs(s) > 1.0e-6, do: (if(s > 0, do: h, else: -h) - y) / s, else: 9.0

    for {cx, cy, r} <- discs, reduce: min(wall_x, wall_y) |> max(0.0) do
      m ->
        px = cx - x
        py = cy - y
        along = px * c + py * s
        off = px * px + py * py - along * along

        cond do
          px * px + py * py < r * r -> 0.0
          along > 0 and off < r * r -> min(m, along - :math.sqrt(r * r - off))
          true -> m
        end
    end
  end

  defp drive(hall) do
    moved =
      Map.new(hall.robots, fn {id, r} ->
        {wanted, limits, reflex} = Reflex.step(r.reflex, hall.at_ms)
        twist = wheels(r.twist, wanted)
        pose = Body.move(r.pose, twist, 0.05)
        {id, %{r | reflex: reflex, twist: twist, limits: limits, next: pose}}
      end)

    settle(%{hall | robots: moved})
  end

  # First-order lag behind what the gate lets through.
  defp wheels(twist, wanted) do
    k = 0.05 / (@lag_s + 0.05)

    Twist.new(
      twist.linear + k * (wanted.linear - twist.linear),
      twist.turn + k * (wanted.turn - twist.turn)
    )
  end

  # A body that would touch another stops where it is.
  defp settle(hall) do
    list = Map.values(hall.robots)
    {w, h} = hall.half
    fixed = [{hall.landmark, 0.15, :landmark} | hall.dead]

    {robots, touching, min_gap} =
      Enum.reduce(list, {%{}, MapSet.new(), hall.min_gap}, fn r, {done, touching, gap} ->
        others =
          for o <- list, o.id != r.id, do: {Map.get(done, o.id, o).pose, o.profile.radius, o.id}

        gaps =
          for {p, radius, id} <- others ++ fixed,
              do:
                {Pose.distance(r.next, p) - radius - r.profile.radius, Pose.distance(r.pose, p),
                 Pose.distance(r.next, p), id}

        hits =
          for {g, before, after_, id} <- gaps,
              g < 0 and after_ < before,
              do: {min(r.id, id), max(r.id, id)}

        wall? = abs(r.next.x) > w - r.profile.radius or abs(r.next.y) > h - r.profile.radius
        hits = if wall?, do: [{r.id, :wall} | hits], else: hits
        closest = gaps |> Enum.map(&elem(&1, 0)) |> Enum.min(fn -> 100.0 end)

        r =
          if hits == [],
            do: %{r | pose: r.next},
            else: %{r | twist: Twist.zero(), pose: %{r.pose | heading: r.next.heading}}

        {Map.put(done, r.id, r), MapSet.union(touching, MapSet.new(hits)), min(gap, closest)}
      end)

    new = MapSet.difference(touching, hall.touching)

    %{
      hall
      | robots: robots,
        touching: touching,
        contacts: hall.contacts + MapSet.size(new),
        events: for(pair <- new, do: {hall.at_ms, pair}) ++ hall.events,
        min_gap: min_gap
    }
  end

  defp judge(hall) do
    good? =
      Enum.all?(hall.robots, fn {_, r} ->
        r.slot == nil or (Pose.distance(est(r), r.slot) < 0.25 and abs(r.twist.linear) < 0.05)
      end)

    good_ms = if good?, do: hall.good_ms || hall.at_ms
    formed = if good_ms && hall.at_ms - good_ms >= 4000, do: good_ms
    %{hall | good_ms: good_ms, formed_ms: formed}
  end

  defp report(hall) do
    errors = for {_, r} <- hall.robots, r.slot, do: Pose.distance(est(r), r.slot)
    us = Enum.sort(hall.tick_us)

    %{
      formed_s: hall.formed_ms && hall.formed_ms / 1000,
      contacts: hall.contacts,
      min_gap: Float.round(hall.min_gap, 3),
      events: hall.events,
      error: Float.round(Enum.sum(errors) / max(length(errors), 1), 3),
      off: for({id, r} <- hall.robots, r.slot, Pose.distance(est(r), r.slot) > 0.25, do: id),
      tick_us: us |> Enum.at(div(length(us), 2)) |> round(),
      tick_max_us: round(List.last(us)),
      hall: hall
    }
  end
end
