defmodule Sim.Chaos.Draw.Faults do
  @moduledoc false
  # Draws the script of a run (`Sim.Trial.Event`): robots that freeze, or see or hear nothing for a while,
  # parts of their program that crash or hang, a radio that becomes worse for a while, people who press the
  # emergency stop and start again, or ask for another shape. Pure; times in whole seconds.
  alias Sim.Chaos.Draw.Events
  alias Sim.Chaos.Random

  @first_s 5

  @doc "A script, by time, for a run that loses this share of its messages."
  @spec draw(Random.t(), [atom(), ...], pos_integer(), loss :: number()) ::
          {[Sim.Trial.Event.entry()], Random.t()}
  def draw(random, robots, duration_s, loss) do
    {count, random} = Random.weighted(random, [{0, 6}, {1, 3}, {2, 2}, {3, 1}])

    {scripts, random} =
      Random.times(random, count, fn random ->
        {at_s, random} = Random.whole(random, @first_s, Events.last_s(duration_s))
        {leader?, random} = Random.weighted(random, [{true, 1}, {false, 2}])
        {robot, random} = Random.pick(random, robots)

        {kind, random} =
          Random.weighted(random,
            freeze: 4,
            blind: 3,
            deaf: 3,
            crash: 3,
            hang: 3,
            loss: 2,
            estop: 2,
            shape: 2
          )

        script(kind, at_s, if(leader?, do: :leader, else: robot), loss, random)
      end)

    {scripts |> Enum.concat() |> Enum.sort_by(&elem(&1, 0)), random}
  end

  defp script(kind, at_s, who, _loss, random) when kind in [:freeze, :blind, :deaf] do
    {for_s, random} = Random.number(random, 0.5, 12.0, 1)
    {[{at_s, {kind, who, for_s}}], random}
  end

  # A robot that begins anew stands until a person starts it.
  defp script(:crash, at_s, who, _loss, random) do
    {role, random} = Random.pick(random, [:gate, :executive, :pilot, :estop, :comms])
    {for_s, random} = Random.whole(random, 1, 5)
    {[{at_s, {:crash, who, role}}, {at_s + for_s, {:tell, :all, :start}}], random}
  end

  defp script(:hang, at_s, who, _loss, random) do
    {role, random} = Random.pick(random, [:executive, :pilot])
    {for_s, random} = Random.number(random, 0.2, 3.0, 1)
    {[{at_s, {:hang, who, role, for_s}}, {at_s + ceil(for_s) + 1, {:tell, :all, :start}}], random}
  end

  defp script(:loss, at_s, _who, loss, random) do
    {share, random} = Random.number(random, 0.2, 0.5, 2)
    {for_s, random} = Random.whole(random, 2, 30)
    {[{at_s, {:loss, share}}, {at_s + for_s, {:loss, loss}}], random}
  end

  defp script(:estop, at_s, who, _loss, random) do
    {for_s, random} = Random.whole(random, 2, 10)

    {[
       {at_s, {:estop, who}},
       {at_s + for_s, {:reset}},
       {at_s + for_s + 1, {:tell, :all, :start}}
     ], random}
  end

  defp script(:shape, at_s, _who, _loss, random) do
    {kind, random} = Random.pick(random, [:column, :line, :wedge, :triangle, :diamond, :circle])
    {spacing, random} = Random.number(random, 0.8, 2.0, 1)
    {[{at_s, {:tell, :all, {:formation, kind, spacing}}}], random}
  end
end
