defmodule Netns.Story do
  @moduledoc """
  What the logs of all nodes tell, merged by the machine's time. Pure. A line is
  `{microseconds, who, kind, value}`; those of the test itself are by `:net`: `:parts` is who reaches whom,
  by whatever way, and `:killed` a robot.
  """

  # A view has followed a change of the network after so long: a robot is gone after 2 s of silence.
  @detect_us 2_000_000

  @type line :: {us :: integer(), who :: atom(), kind :: atom(), value :: term()}
  @typedoc "How things stand: what robots claim, who reaches whom, where bodies are, and where they should be."
  @type now :: %{
          claims: %{atom() => map()},
          parts: [[atom()]],
          bodies: %{atom() => {float(), float(), float()}},
          slots: %{atom() => [{atom(), float(), float()}]}
        }

  @doc "How things stand, line by line: the line and the state after it."
  @spec scan([line()]) :: [{line(), now()}]
  def scan(lines) do
    start = %{claims: %{}, parts: [], bodies: %{}, slots: %{}}

    {states, _last} =
      Enum.map_reduce(lines, start, fn line, now ->
        next = step(line, now)
        {{line, next}, next}
      end)

    states
  end

  @doc "How things stand at last."
  @spec now([line()]) :: now()
  def now(lines), do: lines |> scan() |> List.last() |> elem(1)

  @doc "What explains why robots do not do as they should, for people: one line each."
  @spec troubles([line()]) :: [String.t()]
  def troubles(lines) do
    for {us, who, kind, value} <- lines,
        kind in [:trouble, :doing, :killed, :boot, :estop, :reset] do
      "#{div(us, 1_000)} ms #{who} #{kind} #{inspect(value)}"
    end
  end

  defp step({_us, who, :claim, nil}, now), do: %{now | claims: Map.delete(now.claims, who)}
  defp step({_us, who, :claim, claim}, now), do: put_in(now.claims[who], claim)
  defp step({_us, who, :boot, _pid}, now), do: %{now | claims: Map.delete(now.claims, who)}
  defp step({_us, :net, :killed, who}, now), do: %{now | claims: Map.delete(now.claims, who)}
  defp step({_us, :net, :parts, parts}, now), do: %{now | parts: parts}
  defp step({_us, who, :body, body}, now), do: put_in(now.bodies[who], body)
  defp step({_us, who, :slots, slots}, now), do: put_in(now.slots[who], slots)
  defp step(_line, now), do: now

  @doc "When something first held from then on, or `nil`."
  @spec first([line()], from :: integer(), (now() -> boolean())) :: integer() | nil
  def first(lines, from, holds?) do
    Enum.find_value(scan(lines), fn {{us, _, _, _}, now} ->
      if us >= from and holds?.(now), do: us
    end)
  end

  @doc "The lines of a kind, from then on, of these robots."
  @spec lines([line()], atom(), integer(), [atom()]) :: [line()]
  def lines(lines, kind, from, robots),
    do: for({us, who, ^kind, _} = line <- lines, us >= from, who in robots, do: line)

  @doc "Who leads all of these, in one epoch, if somebody does."
  @spec leader(now(), [atom()]) :: atom() | nil
  def leader(now, robots) do
    with [{leader, epoch}] <-
           for(robot <- robots, %{phase: :lead} = c <- [now.claims[robot]], do: {robot, c.epoch}),
         true <- Enum.all?(List.delete(robots, leader), &follows?(now.claims[&1], leader, epoch)) do
      leader
    else
      _none_or_several -> nil
    end
  end

  defp follows?(claim, leader, epoch),
    do: match?(%{phase: :follow, leader: ^leader, epoch: ^epoch}, claim)

  @doc "Whether these are one formation, as they claim: all named by the leader, all in their places."
  @spec formed?(now(), [atom()]) :: boolean()
  def formed?(now, robots) do
    with leader when leader != nil <- leader(now, robots),
         %{formed: true, order: order} <- now.claims[leader] do
      followers = List.delete(robots, leader)

      Enum.sort(order) == Enum.sort(followers) and
        Enum.all?(followers, &now.claims[&1].in_place)
    else
      _none -> false
    end
  end

  @doc "How far the bodies are from where their leader wants them, at most, in metres."
  @spec error(now(), leader :: atom()) :: float()
  def error(now, leader) do
    for {robot, x, y} <- now.slots[leader], {bx, by, _heading} = now.bodies[robot], reduce: 0.0 do
      worst -> max(worst, :math.sqrt((bx - x) ** 2 + (by - y) ** 2))
    end
  end

  @doc """
  For how long two robots that reached each other both led, at most, in ms: `all` of it, and `late`, which
  begins 2 s after the network had brought the two together. So long it may take to know who is there
  (a peer is gone after 2 s of silence, and may be back as late); from then on the lease is the limit.
  """
  @spec two_leaders([line()]) :: %{all: float(), late: float()}
  def two_leaders(lines) do
    states = scan(lines)
    none = %{worst: %{all: 0.0, late: 0.0}, since: %{}, met: %{}}

    states
    |> Enum.zip(tl(states))
    |> Enum.reduce(none, fn {{{from, _, _, _}, now}, {{to, _, _, _}, _next}}, s ->
      pairs = pairs(now.parts)
      both = Enum.filter(pairs, fn {a, b} -> leads?(now, a) and leads?(now, b) end)
      met = Map.new(pairs, &{&1, Map.get(s.met, &1, from)})
      since = Map.new(both, &{&1, Map.get(s.since, &1, from)})

      worst =
        for {pair, begun} <- since, reduce: s.worst do
          %{all: all, late: late} ->
            noticed = max(begun, met[pair] + @detect_us)
            %{all: max(all, (to - begun) / 1000), late: max(late, (to - noticed) / 1000)}
        end

      %{worst: worst, since: since, met: met}
    end)
    |> Map.fetch!(:worst)
  end

  defp leads?(now, robot), do: match?(%{phase: :lead}, now.claims[robot])
  defp pairs(parts), do: for(part <- parts, a <- part, b <- part, a < b, do: {a, b})

  @doc "The rounds since then that not all who committed them committed alike, with who, when, and which digest."
  @spec torn_rounds([line()], from :: integer()) ::
          [{id :: tuple(), [{integer(), atom(), String.t()}]}]
  def torn_rounds(lines, from) do
    commits =
      for {us, who, :commit, {id, digest}} <- lines, us >= from, do: {id, {us, who, digest}}

    for {id, commits} <- Enum.group_by(commits, &elem(&1, 0), &elem(&1, 1)),
        match?([_, _ | _], Enum.uniq_by(commits, &elem(&1, 2))),
        do: {id, commits}
  end
end
