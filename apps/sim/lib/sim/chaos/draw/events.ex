defmodule Sim.Chaos.Draw.Events do
  @moduledoc false
  # Draws what happens during a run: moves of the landmark, kills, cuts of the radio. Pure; times in
  # whole seconds.
  alias Sim.Chaos.Random

  # So that most fleets have time to form again before the run ends.
  @rest_s 40
  @first_s 5

  @doc "The last second at which something may begin."
  @spec last_s(pos_integer()) :: pos_integer()
  def last_s(duration_s), do: max(duration_s - @rest_s, @first_s)

  @doc """
  The options `moves`, `kills` and `cuts`. `place` draws where the landmark can be moved to.
  """
  @spec draw(
          Random.t(),
          [atom(), ...],
          pos_integer(),
          (Random.t() -> {Hal.Pose.point(), Random.t()})
        ) :: {keyword(), Random.t()}
  def draw(random, robots, duration_s, place) do
    last_s = last_s(duration_s)
    {moves, random} = moves(random, last_s, place)
    {kills, random} = kills(random, robots, last_s)
    {cuts, random} = cuts(random, robots, last_s)
    {[moves: moves, kills: kills, cuts: cuts], random}
  end

  defp moves(random, last_s, place) do
    {count, random} = Random.weighted(random, [{0, 5}, {1, 3}, {2, 1}, {3, 1}])

    {moves, random} =
      Random.times(random, count, fn random ->
        {place, random} = place.(random)
        {at_s, random} = Random.whole(random, @first_s, last_s)
        {{place, at_s}, random}
      end)

    {Enum.sort_by(moves, &elem(&1, 1)), random}
  end

  # At most half of the fleet dies.
  defp kills(random, robots, last_s) do
    {count, random} = Random.weighted(random, [{0, 5}, {1, 4}, {2, 2}, {3, 1}])

    {kills, random} =
      Random.times(random, min(count, div(length(robots), 2)), fn random ->
        {leader?, random} = Random.weighted(random, [{true, 1}, {false, 1}])
        {robot, random} = Random.pick(random, robots)
        {at_s, random} = Random.whole(random, @first_s, last_s)
        {{if(leader?, do: :leader, else: robot), at_s}, random}
      end)

    {Enum.sort_by(kills, fn {who, at_s} -> {at_s, who} end), random}
  end

  defp cuts(random, [_only], _last_s), do: {[], random}

  defp cuts(random, robots, last_s) do
    {count, random} = Random.weighted(random, [{0, 5}, {1, 3}, {2, 2}, {3, 1}])
    {cuts, random} = Random.times(random, count, &cut(&1, robots, last_s))
    {Enum.sort_by(cuts, &elem(&1, 0)), random}
  end

  defp cut(random, robots, last_s) do
    {from_s, random} = Random.whole(random, 0, last_s - 1)
    {length_s, random} = Random.weighted(random, short: 2, long: 3, for_ever: 1)

    {to_s, random} =
      case length_s do
        :short -> Random.whole(random, from_s + 1, min(from_s + 5, last_s))
        :long -> Random.whole(random, from_s + 1, min(from_s + 60, last_s))
        :for_ever -> {:end, random}
      end

    {what, random} = what(random, robots)
    {{from_s, to_s, what}, random}
  end

  defp what(random, robots) do
    {kind, random} = Random.weighted(random, groups: 4, link: 2, way: 2)
    {mixed, random} = Random.shuffle(random, robots)

    case kind do
      :groups ->
        {first, random} = Random.whole(random, 1, length(robots) - 1)
        {left, right} = Enum.split(mixed, first)
        {[Enum.sort(left), Enum.sort(right)], random}

      way ->
        [a, b | _others] = mixed
        {{way, a, b}, random}
    end
  end
end
