defmodule Soak.Judge do
  @moduledoc """
  Judges a run of `bin/soak` by what was done and by what the nodes' logs tell. Pure. An event is
  `{microseconds, who, kind, value}`: those of robots as `Soak.Recorder` says it, those of the run itself by
  `:soak`.

  | of `:soak` | value |
  |---|---|
  | `:up`, `:down` | a node: it is there, it has ended |
  | `:freeze`, `:thaw`, `:process` | the robot that it was done to |
  | `:world` | its process has ended, or is back |
  | `:cut`, `:heal` | the pairs that are parted; `nil` |
  | `:network` | packets are lost from then on, or no more |
  | `:estop`, `:reset` | the robot; `nil` |
  | `:estop_refused` | the robot whose node answered that it knows of no robot that could be held |
  | `:start` | a start of the mission was ordered |
  | `:collisions` | how many there have been in the world, and the newest of them in words, newest first |
  | `:orphans` | `{node, lines}` |
  """
  alias Soak.Links
  alias Soak.Judge.{Growth, Health, Leaders, Stops}

  # A new session is believed when the old one has been silent for 2 s, and a process needs a moment to start.
  @deaf_us 3_000_000

  defstruct [:links, :health, leaders: %Leaders{}, stops: %Stops{}, growth: %Growth{}] ++
              [claims: %{}, collisions: 0, told: MapSet.new(), checks: 0]

  @typedoc "`told` are the violations that were told: each once."
  @type t :: %__MODULE__{}
  @type event :: {us :: integer(), who :: atom(), kind :: atom(), value :: term()}

  @doc "Nothing has happened yet."
  @spec new([atom(), ...]) :: t()
  def new(robots), do: %__MODULE__{links: Links.new(robots), health: Health.new(robots)}

  @doc "Takes an event; returns the violations that it shows, one line each."
  @spec note(t(), event()) :: {[String.t()], t()}
  def note(judge, {us, who, kind, value}) do
    {wrong, judge} = take(judge, us, who, kind, value)
    fresh(judge, wrong)
  end

  @doc "Judges how things stand; returns the violations, one line each. Each is told once."
  @spec judge(t(), integer()) :: {[String.t()], t()}
  def judge(judge, now) do
    {two, leaders} = Leaders.judge(judge.leaders, judge.links, now)
    free = judge.stops.order == nil
    held = if free, do: for({robot, true} <- Enum.sort(judge.stops.held), do: robot), else: []
    {sick, health} = Health.judge(judge.health, held, judge.claims, now)
    wrong = two ++ Stops.judge(judge.stops, judge.links, now) ++ sick
    fresh(%{judge | leaders: leaders, health: health, checks: judge.checks + 1}, wrong)
  end

  defp fresh(judge, wrong) do
    new = for {line, key} <- wrong, not MapSet.member?(judge.told, key), do: {line, key}

    {for({line, _key} <- new, do: line),
     %{judge | told: MapSet.union(judge.told, MapSet.new(new, &elem(&1, 1)))}}
  end

  defp take(judge, us, :soak, :up, robot) do
    judge = %{
      judge
      | links: Links.come(judge.links, robot, us),
        growth: Growth.start(judge.growth, robot, us)
    }

    # Its time to heal began when it went down.
    if is_map_key(judge.health.touched, robot),
      do: {[], judge},
      else: {[], touch(judge, [robot], us)}
  end

  defp take(judge, us, :soak, :down, robot),
    do: {[], judge |> gone(robot, us) |> touch([robot], us)}

  defp take(judge, us, :soak, :freeze, robot),
    do: {[], touch(%{judge | links: Links.go(judge.links, robot)}, [robot], us)}

  defp take(judge, us, :soak, :thaw, robot),
    do: {[], touch(%{judge | links: Links.come(judge.links, robot, us)}, [robot], us)}

  defp take(judge, us, :soak, :process, robot),
    do: {[], touch(%{judge | links: Links.touch(judge.links, robot, us + @deaf_us)}, [robot], us)}

  defp take(judge, us, :soak, :cut, pairs),
    do: {[], touch(%{judge | links: Links.cut(judge.links, pairs, us)}, judge.links.robots, us)}

  defp take(judge, us, :soak, :heal, _whole),
    do: {[], touch(%{judge | links: Links.heal(judge.links, us)}, judge.links.robots, us)}

  defp take(judge, us, :soak, kind, _value) when kind in [:world, :network, :start],
    do: {[], touch(judge, judge.links.robots, us)}

  defp take(judge, us, :soak, :estop, robot),
    do: {[], touch(%{judge | stops: Stops.order(judge.stops, robot, us)}, judge.links.robots, us)}

  defp take(judge, us, :soak, :estop_refused, _robot),
    do: {[], touch(%{judge | stops: Stops.refuse(judge.stops)}, judge.links.robots, us)}

  defp take(judge, us, :soak, :reset, _value),
    do: {[], touch(%{judge | stops: Stops.release(judge.stops)}, judge.links.robots, us)}

  defp take(judge, _us, :soak, :collisions, {count, words}) do
    new = count - judge.collisions
    newest = words |> Enum.take(max(new, 0)) |> Enum.reverse() |> Enum.join("; ")
    wrong = if new > 0, do: [{"#{new} new collisions: #{newest}", {:collisions, count}}], else: []
    {wrong, %{judge | collisions: count}}
  end

  defp take(judge, us, :soak, :orphans, {node, lines}),
    do:
      {[{"#{node} has left processes behind: #{Enum.join(lines, ", ")}", {:orphans, node, us}}],
       judge}

  defp take(judge, us, robot, :claim, claim) do
    leaders = Leaders.note(judge.leaders, robot, claim, us)
    {[], %{judge | leaders: leaders, claims: Map.put(judge.claims, robot, claim)}}
  end

  defp take(judge, us, robot, :held, held),
    do: {[], %{judge | stops: Stops.note(judge.stops, robot, held, us, judge.links)}}

  defp take(judge, us, robot, :probe, probe) do
    {wrong, growth} = Growth.note(judge.growth, robot, probe, us)
    {wrong, %{judge | growth: growth, health: Health.note(judge.health, robot, probe, us)}}
  end

  defp take(judge, _us, _who, _kind, _value), do: {[], judge}

  defp touch(judge, robots, us), do: %{judge | health: Health.touch(judge.health, robots, us)}

  # What it claimed last counts no more.
  defp gone(judge, robot, us) do
    %{
      judge
      | links: Links.go(judge.links, robot),
        leaders: Leaders.note(judge.leaders, robot, nil, us),
        claims: Map.delete(judge.claims, robot),
        stops: Stops.note(judge.stops, robot, nil, us, judge.links),
        health: Health.note(judge.health, robot, nil, us)
    }
  end
end
