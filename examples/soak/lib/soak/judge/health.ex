defmodule Soak.Judge.Health do
  @moduledoc """
  Judges whether robots heal: so long after the last disturbance of a robot all its processes are back, its
  devices are online, and it is well in the words of systemd's watchdog; and so long after the last one of any
  robot all hear and list all, nobody is held by a stop that was released, and all are one group. Pure; times in microseconds.

  The bounds are sums of what docs/times.md and rel/convoy.service allow: 2 s until a node is started
  again, its start on a busy machine, back-off of devices and connections up to 5 s each.
  """

  @self_us 20_000_000
  @all_us 25_000_000
  @stale_us 3_000_000

  defstruct robots: [],
            probes: %{},
            expected: %{},
            touched: %{},
            open: %{},
            worst_us: %{self: 0, all: 0},
            looks: 0,
            whole: 0

  @typedoc """
  `touched` is when a robot was last disturbed, `open` who has not healed since; `expected` is what ran when all was well
  for the first time. Of so many `looks` at all, all were one whole group in `whole`.
  """
  @type t :: %__MODULE__{}

  @doc "Robots that are about to start."
  @spec new([atom()]) :: t()
  def new(robots), do: %__MODULE__{robots: robots}

  @doc "Robots were disturbed."
  @spec touch(t(), [atom()], integer()) :: t()
  def touch(health, robots, us) do
    keys = [:all | robots]
    touched = Enum.reduce(keys, health.touched, &Map.update(&2, &1, us, fn at -> max(at, us) end))
    %{health | touched: touched, open: Enum.reduce(keys, health.open, &Map.put(&2, &1, true))}
  end

  @doc "A robot has told how it is; `nil` when it is gone."
  @spec note(t(), atom(), map() | nil, integer()) :: t()
  def note(health, robot, nil, _us), do: %{health | probes: Map.delete(health.probes, robot)}

  def note(health, robot, probe, us) do
    health = put_in(health.probes[robot], {probe, us})
    # What ran when it was well and whole for the first time.
    if not is_map_key(health.expected, robot) and match?({true, _}, probe.well) and
         probe.offline == [],
       do: put_in(health.expected[robot], probe.processes),
       else: health
  end

  @doc "What is wrong now; `held` is who is held though no stop is in force, `claims` what robots claim."
  @spec judge(t(), [atom()], %{atom() => map()}, integer()) :: {[{String.t(), term()}], t()}
  def judge(health, held, claims, now) do
    selves = for robot <- health.robots, do: {robot, faults(health, robot, now), @self_us}

    group =
      Enum.flat_map(health.robots, &apart(health, &1)) ++
        for(robot <- held, do: "#{robot} is held") ++ split(health, claims)

    whole =
      if Enum.all?(selves, fn {_robot, faults, _us} -> faults == [] end),
        do: group,
        else: ["not all are well"]

    health = %{
      health
      | looks: health.looks + 1,
        whole: health.whole + if(whole == [], do: 1, else: 0)
    }

    Enum.reduce([{:all, whole, @all_us} | selves], {[], health}, &judged(&1, &2, now))
  end

  defp judged({who, faults, bound_us}, {wrong, health}, now) do
    since = health.touched[who]

    cond do
      since == nil or (not is_map_key(health.open, who) and faults == []) ->
        {wrong, health}

      faults == [] ->
        kind = if who == :all, do: :all, else: :self
        worst = Map.update!(health.worst_us, kind, &max(&1, now - since))
        {wrong, %{health | open: Map.delete(health.open, who), worst_us: worst}}

      now - since > bound_us ->
        line =
          "#{who}, #{div(now - since, 1_000_000)} s after the last disturbance: #{Enum.join(faults, "; ")}"

        {[{line, {:health, who, since}} | wrong], health}

      true ->
        {wrong, health}
    end
  end

  # What a robot lacks itself, in words.
  defp faults(health, robot, now) do
    case health.probes[robot] do
      {probe, us} when now - us <= @stale_us ->
        lost = Map.get(health.expected, robot, []) -- probe.processes
        {well?, words} = probe.well

        if(well?, do: [], else: [words]) ++
          for(device <- probe.offline, do: "#{device} is offline") ++
          for(process <- lost, do: "#{process} does not run")

      _old_or_none ->
        ["it tells nothing"]
    end
  end

  defp apart(health, robot) do
    case health.probes[robot] do
      {probe, _us} ->
        deaf = health.robots -- [robot | probe.peers]
        blind = health.robots -- probe.listed

        for(other <- deaf, do: "#{robot} does not hear #{other}") ++
          for(other <- blind, do: "#{robot} does not list #{other}")

      nil ->
        []
    end
  end

  defp split(health, claims) do
    groups =
      for robot <- health.robots,
          claim = Map.get(claims, robot, %{}),
          do: {claim[:leader], claim[:epoch]}

    alone = for robot <- health.robots, claims[robot][:phase] not in [:lead, :follow], do: robot

    case {alone, Enum.uniq(groups)} do
      {[], [_one]} -> []
      {[], many} -> ["#{length(many)} groups"]
      {alone, _groups} -> ["in no group: #{Enum.join(alone, ", ")}"]
    end
  end
end
