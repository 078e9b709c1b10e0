defmodule Console.FakeTrial do
  @moduledoc """
  A stand-in for `Lab.Trial` with the same functions: robots that turn for five seconds, elect,
  and drive straight to their places. It exists so that the views are tested without a world.
  """
  alias Hal.Pose
  alias Sim.Scene

  defstruct [
    :options,
    :at_ms,
    :robots,
    :leader,
    :landmark,
    :stages,
    :epoch,
    :formed_ms,
    :goal,
    :script
  ]

  def setup(options), do: new(options)
  def begin(trial, _options), do: trial

  def new(%{map: "nowhere"}), do: {:error, "the map \"nowhere\" cannot be read"}

  def new(options) do
    options = Map.merge(Console.Options.trial(%Console.Options{robots: [:mag1]}), options)
    landmark = %{none: nil, default: {0.0, 0.0}}[options.landmark] || point(options.landmark)
    count = length(options.robots)

    {:ok, bodies} = Lab.Trial.Options.bodies(options.robots, [])

    robots =
      for {id, k} <- Enum.with_index(options.robots) do
        angle = 2.4 * k + options.seed
        far = 2.2 + 3.0 * :math.sqrt((k + 1) / count)
        pose = Pose.new(far * 1.25 * :math.cos(angle), far * 0.9 * :math.sin(angle), angle * 1.7)

        %{
          id: id,
          pose: pose,
          radius: 0.25,
          corners: Hal.Profile.corners(bodies[id]),
          alive: true,
          state: :search,
          slot: nil,
          leader?: false,
          uncertainty: 0.04,
          size_ppm: nil
        }
      end

    script =
      for({place, at_s} <- options.moves, do: {round(at_s * 1000), {:move, place}}) ++
        for {who, at_s} <- options.kills, do: {round(at_s * 1000), {:kill, who}}

    {:ok,
     %__MODULE__{
       options: options,
       at_ms: 0,
       robots: robots,
       landmark: landmark,
       goal: landmark,
       epoch: 0,
       stages: [%{stage: :search, at_s: 0.0}],
       script: Enum.sort(script)
     }}
  end

  defp point({_x, _y} = point), do: point
  defp point(_other), do: nil

  def step(trial) do
    trial = %{trial | at_ms: trial.at_ms + 100}
    trial |> run_script() |> glide() |> elect() |> drive() |> judge()
  end

  def formed?(trial), do: trial.formed_ms != nil
  def kill(trial, who), do: act(trial, {:kill, who})
  def move(_trial, {x, _y}) when x > 8, do: {:error, "there is a wall"}
  def move(trial, place), do: {:ok, act(trial, {:move, place})}
  def living(trial), do: for(robot <- trial.robots, robot.alive, do: robot.id)

  def ask(trial, :all, {:formation, kind, spacing}) do
    options = %{trial.options | formation: {kind, spacing}}
    {%{trial | options: options, formed_ms: nil}, Map.new(living(trial), &{&1, :ok})}
  end

  def ask(trial, :all, _command), do: {trial, Map.new(living(trial), &{&1, :ok})}
  def ask(trial, id, {:goto, _x, _y, _heading}), do: {trial, %{id => {:error, "#{id}: no"}}}
  def ask(trial, id, _command), do: {trial, %{id => :ok}}

  def done?(%{options: options} = trial) do
    trial.at_ms >= options.duration_s * 1000 or
      (trial.formed_ms != nil and trial.script == [] and trial.at_ms - trial.formed_ms >= 5000)
  end

  def scene(trial) do
    %Scene{
      at_ms: trial.at_ms,
      map: room(trial.options.map, 16.0, 12.0),
      robots: trial.robots,
      landmark: trial.landmark,
      leader: trial.leader,
      epoch: trial.epoch,
      formation: trial.options.formation,
      error: error(trial),
      formed?: trial.formed_ms != nil,
      stages: trial.stages
    }
  end

  def result(trial) do
    {kind, spacing} = trial.options.formation
    {mean, max} = error(trial) || {nil, nil}

    %{
      version: 1,
      seed: trial.options.seed,
      map: trial.options.map,
      robots: length(trial.robots),
      simulated_s: trial.at_ms / 1000,
      stages: trial.stages,
      leader: trial.leader,
      leaders_at_once_max: if(trial.leader, do: 1, else: 0),
      leader_changes: max(0, trial.epoch - 1),
      mission: nil,
      formation: %{
        kind: kind,
        spacing_m: spacing,
        error_mean_m: mean,
        error_max_m: max,
        share_of_time_formed: 0.51234
      },
      landmark_distance_m: 1.23456,
      collisions: 0,
      min_separation_m: 0.61,
      claims: claims(trial),
      stuck: [],
      messages: %{sent: 1234, lost: 0},
      fleet:
        for r <- trial.robots do
          %{
            name: r.id,
            alive: r.alive,
            state: r.state,
            says: nil,
            blocked_by: nil,
            x: r.pose.x,
            y: r.pose.y,
            theta: r.pose.heading,
            slot: slot(trial, r),
            error_m: Scene.slot_error(r),
            uncertainty_m: r.uncertainty,
            size_ppm: r.size_ppm
          }
        end
    }
  end

  defp claims(%{formed_ms: nil}), do: []

  defp claims(%{formed_ms: at_ms, leader: leader}),
    do: [%{at_s: at_ms / 1000, robot: leader, worst_m: 0.21111, worst_5s_m: 0.62222}]

  defp slot(_trial, %{slot: nil}), do: nil

  defp slot(trial, robot),
    do: Enum.find_index(living(trial) -- [trial.leader], &(&1 == robot.id)) + 1

  defp run_script(%{script: [{at_ms, act} | rest], at_ms: now} = trial) when at_ms <= now,
    do: run_script(act(%{trial | script: rest}, act))

  defp run_script(trial), do: trial

  defp act(trial, {:move, place}),
    do: happened(%{trial | goal: place, formed_ms: nil}, %{stage: :landmark_moved})

  defp act(trial, {:kill, :leader}), do: act(trial, {:kill, trial.leader})
  defp act(trial, {:kill, nil}), do: trial

  defp act(trial, {:kill, id}) do
    robots =
      for r <- trial.robots,
          do:
            if(r.id == id,
              do: %{r | alive: false, state: :dead, slot: nil, leader?: false},
              else: r
            )

    trial = happened(%{trial | robots: robots, formed_ms: nil}, %{stage: :killed, robot: id})
    if trial.leader == id, do: %{trial | leader: nil}, else: trial
  end

  defp glide(%{landmark: {x, y}, goal: {gx, gy}} = trial) when {x, y} != {gx, gy} do
    far = Pose.distance({x, y}, {gx, gy})
    f = min(1.0, 0.03 / far)
    %{trial | landmark: if(f >= 1, do: {gx, gy}, else: {x + f * (gx - x), y + f * (gy - y)})}
  end

  defp glide(trial), do: trial

  defp elect(%{leader: nil, at_ms: now, landmark: {_, _} = landmark} = trial) when now >= 5000 do
    leader =
      trial.robots
      |> Enum.filter(& &1.alive)
      |> Enum.min_by(&Pose.distance(&1.pose, landmark), fn -> nil end)

    if leader do
      trial = %{trial | leader: leader.id, epoch: trial.epoch + 1}
      happened(trial, %{stage: :elected, robot: leader.id, epoch: trial.epoch, size_ppm: 41_000})
    else
      trial
    end
  end

  defp elect(trial), do: trial

  defp drive(%{leader: nil} = trial) do
    robots =
      for r <- trial.robots,
          do:
            if(r.alive,
              do: %{r | pose: Pose.new(r.pose.x, r.pose.y, r.pose.heading + 0.035)},
              else: r
            )

    %{trial | robots: robots}
  end

  defp drive(trial) do
    leader = Enum.find(trial.robots, &(&1.id == trial.leader))
    {lx, ly} = trial.landmark
    bearing = :math.atan2(ly - leader.pose.y, lx - leader.pose.x)
    ahead = Pose.distance(leader.pose, trial.landmark) - 1.2
    pose = towards(leader.pose, bearing, max(0.0, ahead))
    base = Pose.new(pose.x, pose.y, pose.heading)
    ids = for r <- trial.robots, r.alive, r.id != trial.leader, do: r.id

    robots =
      for r <- trial.robots do
        cond do
          not r.alive ->
            r

          r.id == trial.leader ->
            %{r | pose: pose, leader?: true, state: :lead, slot: nil, size_ppm: 45_000}

          true ->
            follow(r, base, Enum.find_index(ids, &(&1 == r.id)) + 1, trial.options.formation)
        end
      end

    %{trial | robots: robots}
  end

  defp follow(r, base, k, {kind, spacing}) do
    slot = Pose.place(base, place(kind, k, spacing))
    {sx, sy} = slot
    far = Pose.distance(r.pose, slot)

    bearing = if far < 0.1, do: base.heading, else: :math.atan2(sy - r.pose.y, sx - r.pose.x)

    pose = towards(r.pose, bearing, far)
    %{r | pose: pose, slot: slot, state: :follow, leader?: false, size_ppm: 9_000 - 500 * k}
  end

  defp place(:column, k, d), do: {-k * d, 0.0}

  defp place(_wedge, k, d),
    do: {-div(k + 1, 2) * d * 0.7, if(rem(k, 2) == 1, do: 1, else: -1) * div(k + 1, 2) * d * 0.7}

  defp towards(pose, heading, far) do
    off = Pose.wrap(heading - pose.heading)
    step = min(0.05, far * 0.2) * max(0.0, :math.cos(off))
    turned = pose.heading + max(-0.1, min(0.1, Pose.wrap(heading - pose.heading)))
    Pose.new(pose.x + step * :math.cos(turned), pose.y + step * :math.sin(turned), turned)
  end

  defp judge(trial) do
    case error(trial) do
      {_mean, max} when max < 0.25 and trial.formed_ms == nil ->
        happened(%{trial | formed_ms: trial.at_ms}, %{stage: :formed})

      _ ->
        trial
    end
  end

  defp error(trial) do
    case for r <- trial.robots, r.slot, do: Scene.slot_error(r) do
      [] -> nil
      errors -> {Enum.sum(errors) / length(errors), Enum.max(errors)}
    end
  end

  defp happened(trial, stage),
    do: %{trial | stages: trial.stages ++ [Map.put(stage, :at_s, trial.at_ms / 1000)]}

  @doc "An empty room with walls of 0.2 m."
  def room(name, width, height) do
    wall? = fn x, y -> abs(x) > width / 2 - 0.2 or abs(y) > height / 2 - 0.2 end
    %Console.Picture.MapView{name: name, width: width, height: height, wall?: wall?}
  end
end
