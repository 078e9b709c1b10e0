defmodule Bench do
  @moduledoc """
  Lists the cases in which the landmark mission is measured, as one table. Pure.

  A case is a run's options and what is done to the fleet once it has been in formation for 2 s:
  `:move` pushes the landmark 3 m, `:kill_leader` and `:kill_middle` kill a robot. The time of such
  a case counts from that moment, else from the start.
  """

  alias Hal.Cli.Parse

  @type deed :: nil | :move | :kill_leader | :kill_middle
  @type case :: %{
          name: String.t(),
          options: map(),
          deed: deed(),
          limit_s: number(),
          says: String.t()
        }

  @doc "All cases."
  @spec cases() :: [case()]
  def cases do
    [
      at("six", "6 robots, default noise", %{}, nil, 120),
      at("exact", "6 robots, no noise", %{noise: :off}, nil, 120),
      at("move", "the landmark moves by 3 m", %{}, :move, 40),
      at(
        "swing",
        "the same, chain, no change of leader",
        %{assign: :chain, leader_change: false},
        :move,
        40
      ),
      at("kill-leader", "the leader dies", %{}, :kill_leader, 60),
      at("kill-middle", "a robot in the middle dies", %{}, :kill_middle, 30),
      at("loss", "6 robots, 20 % of the messages lost", %{loss: 0.2}, nil, 180),
      at("loss-move", "loss, and the landmark moves", %{loss: 0.2}, :move, 60),
      at("loss-kill-leader", "loss, and the leader dies", %{loss: 0.2}, :kill_leader, 90),
      at("loss-kill-middle", "loss, and a middle robot dies", %{loss: 0.2}, :kill_middle, 45),
      at("slip", "6 robots, wheels that slip", %{noise: :slip}, nil, 180),
      at("one", "1 robot", %{robots: 1}, nil, 180),
      at("two", "2 robots", %{robots: 2}, nil, 180),
      at("three", "3 robots", %{robots: 3}, nil, 180),
      at("twelve", "12 robots", %{robots: 12}, nil, 180),
      at("twelve-slip", "12 robots, wheels that slip", %{robots: 12, noise: :slip}, nil, 180),
      at("twenty", "20 robots", %{robots: 20}, nil, 180),
      at("twenty-slip", "20 robots, wheels that slip", %{robots: 20, noise: :slip}, nil, 180),
      at("none", "no landmark", %{landmark: :none}, nil, 120),
      at("same", "6 robots, all switched on at one place", %{start: :same}, nil, 120),
      at("chain", "6 robots, slots by the thesis's chain", %{assign: :chain}, nil, 120),
      at("twelve-chain", "12 robots, chain", %{robots: 12, assign: :chain}, nil, 180),
      at("twenty-chain", "20 robots, chain", %{robots: 20, assign: :chain}, nil, 180)
      | shapes()
    ]
  end

  defp shapes do
    for kind <- [:line, :wedge, :triangle, :diamond, :circle],
        do: at("#{kind}", "6 robots, #{kind}", %{formation: {kind, 1.0}}, nil, 120)
  end

  @doc """
  Cases by name, in the order of the table.

      iex> {:ok, cases} = Bench.choose("move,six")
      iex> Enum.map(cases, & &1.name)
      ["six", "move"]
      iex> {:error, allowed} = Bench.choose("sicks")
      iex> allowed =~ "names of six, exact"
      true
  """
  @spec choose(String.t()) :: {:ok, [case()]} | {:error, String.t()}
  def choose(text), do: Parse.named(text, cases())

  @doc """
  The time within which the fleet should be in formation (again). Where there are doors and corners
  a fresh fleet has longer.

      iex> {:ok, [six]} = Bench.choose("six")
      iex> {Bench.limit_s(six, "hall"), Bench.limit_s(six, "hospital")}
      {120, 180}
  """
  @spec limit_s(case(), String.t()) :: number()
  def limit_s(%{deed: nil, limit_s: 120}, map),
    do: trunc(Console.Options.duration_s(%Console.Options{map: map}))

  def limit_s(%{limit_s: limit_s}, _map), do: limit_s

  @doc """
  The cases that another mission than the landmark's can be measured in: those that name no
  shape, no landmark and no leader. A robot in the middle of a formation is one of its robots then.

      iex> names = for case <- Bench.of_any_mission(Bench.cases()), do: case.name
      iex> {"six" in names, "loss" in names, "wedge" in names, "kill-leader" in names}
      {true, true, false, false}
  """
  @spec of_any_mission([case()]) :: [case()]
  def of_any_mission(cases) do
    own = [:formation, :assign, :landmark, :leader_change]
    for case <- cases, case.deed == nil, Map.take(case.options, own) == %{}, do: case
  end

  @doc "The options of `Lab.Trial.new/1` for a case, a map and a seed."
  @spec options(case(), String.t(), integer(), :painted | :direct) :: map()
  def options(case, map, seed, blobs) do
    limit_s = limit_s(case, map)
    # Before something is done to the fleet, it has 180 s to get into formation at all.
    duration_s = if case.deed, do: 180.0 + limit_s + 10, else: limit_s * 1.0
    robots = Console.Fleet.of(Map.get(case.options, :robots, 6))

    Map.merge(
      case.options,
      %{robots: robots, map: map, seed: seed, blobs: blobs, duration_s: duration_s}
    )
  end

  defp at(name, says, options, deed, limit_s),
    do: %{name: name, says: says, options: options, deed: deed, limit_s: limit_s}
end
