defmodule Lab.Trial.Options do
  @moduledoc "Checks the options of a run, with their defaults. Pure."
  alias Hal.Options
  alias Hal.Options.{Suggest, Type, Wording}
  alias Hal.{Profile, RobotName}
  alias Robot.File.Bodies
  alias Missions.Landmark
  alias Lab.Trial.{Cuts, Event, WorldFile}
  alias Swarm.MissionRegistry

  @metres List.duplicate({:number, -1.0e4, 1.0e4, "m"}, 2)
  @place {:tuple, @metres, "{x, y} in metres"}
  @pose {:tuple, List.duplicate({:number, -1.0e4, 1.0e4}, 3), "{x, y, degrees}"}
  # The options of the mission, without those that the robots know themselves.
  @mission [formation: {:column, 1.0}, assign: :cost, leader_change: true, policy: :available] ++
             [of: nil, lost_link: nil]

  @doc """
  All options, with defaults for those that are not given; the error is one line that names what
  is wrong.

      iex> {:ok, options} = Lab.Trial.Options.check(robots: [:mag1], formation: :wedge)
      iex> {options.robots, options.formation, options.map}
      {[:mag1], {:wedge, 1.0}, "hall"}
      iex> {:error, line} = Lab.Trial.Options.check(nois: :off)
      iex> line =~ ~r/^trial option nois is not known: allowed are robots, bodies, seed, .*; did you mean noise\\?$/
      true
      iex> Lab.Trial.Options.check(robots: 12)
      {:error, "trial option robots: expected a list of different names, [:mag1, :burger1], got 12"}
      iex> {:ok, options} = Lab.Trial.Options.check(robots: [:rex, :mag1], bodies: [rex: :kobuki])
      iex> Enum.sort(for {id, body} <- options.bodies, do: {id, body.name})
      [mag1: :magellan, rex: :kobuki]
  """
  @spec check(keyword() | map()) :: {:ok, map()} | {:error, line :: String.t()}
  def check(asked) when is_map(asked), do: asked |> Map.to_list() |> check()

  def check(asked) do
    with {:ok, asked} <- world(asked),
         {:ok, options} <- Options.check(asked, table(), "trial"),
         options = Map.merge(Map.new(@mission), Map.new(options)),
         {:ok, options} <- named(options),
         [] <- problems(options),
         {:ok, bodies} <- bodies(options.robots, options.bodies),
         options = %{options | bodies: bodies},
         :ok <- hardware(options) do
      {:ok, options}
    else
      [_ | _] = problems -> {:error, Options.line(problems, "trial")}
      error -> error
    end
  end

  # What the file of a world says, under what else is asked.
  defp world(asked) do
    with true <- Keyword.keyword?(asked),
         {file, asked} when is_binary(file) <- Keyword.pop(asked, :world),
         {:own, nil} <- {:own, Enum.find(WorldFile.keys(), &Keyword.has_key?(asked, &1))},
         {:ok, world} <- WorldFile.open(file) do
      {:ok, Keyword.merge(world.options, asked)}
    else
      {:own, key} -> {:error, "trial option #{key} is said by the world's file; leave it out"}
      {:error, line} -> {:error, "trial option world: #{line}"}
      _no_world -> {:ok, asked}
    end
  end

  @doc "The table of all options: what is allowed."
  @spec table() :: Options.table()
  def table, do: own() ++ mission() ++ [mission: [MissionRegistry.type(), default: nil]]

  defp own do
    [
      robots: [
        {:check, &robots?/1, "a list of different names, [:mag1, :burger1],"},
        default: [:mag1, :mag2, :mag3, :min1, :min2, :min3]
      ],
      bodies: [
        {:check, &bodies?/1,
         "[rover: :kobuki, mag3: :atrv_mini], bodies by what robots' names begin with,"},
        default: []
      ],
      seed: [:integer, default: 1],
      map: [
        {:path,
         ~s(the name of a map, "FILE.yaml", "FILE.png:WIDTHxHEIGHT" or "FILE.pgm:WIDTHxHEIGHT")},
        default: "hall"
      ],
      world: [{:or, nil, {:path, ~s(the file of a world, "FILE.world")}}, default: nil],
      grey: [{:one_of, [:wall, :floor]}, default: :wall],
      start: [{:or, :spread, {:or, :same, {:list, @pose, 1000}}}, default: :spread],
      landmark: [{:or, :default, {:or, :none, @place}}, default: :default],
      marks: [{:or, nil, {:keys, marks()}}, default: nil],
      balls: [{:list, {:check, &ball/1, "{x, y} or {x, y, radius} in metres"}}, default: []],
      boxes: [
        {:list, {:check, &box/1, "{x, y, degrees} or {x, y, degrees, length, width}"}},
        default: []
      ],
      moves: [{:check, &moves?/1, "[{{x, y}, at_s}]"}, default: []],
      kills: [{:check, &kills?/1, "[{robot, at_s}]"}, default: []],
      script: [Event.script_type(), default: []],
      loss: [{:number, 0, 1}, default: 0.0],
      duplicates: [{:number, 0, 1}, default: 0.0],
      delay_ms: [{:span, 0, 3_600_000, "whole ms"}, default: {5, 50}],
      cuts: [{:check, &Type.list?/1, "[{from_s, to_s, [[:mag1], [:mag2]]}]"}, default: []],
      noise: [{:one_of, [:off, :default, :slip]}, default: :default],
      duration_s: [{:check, &duration?/1, "seconds, 0 to 1000000,"}, default: 120],
      plan: [{:one_of, [:none, :known, :sonar]}, default: :none],
      casts: [{:one_of, [:sent, :drawn]}, default: :sent],
      blobs: [{:one_of, [:painted, :direct]}, default: :painted],
      hardware: [
        {:check, &ids?/1, "a list of robots of this run, [:mag1],"},
        default: []
      ]
    ]
  end

  # Where each hangs, and where it faces: in metres and degrees. What the robots are told of that may be wrong.
  defp marks do
    list = {:list, {:tuple, [{:integer, 0, 65_535}, @pose], "{id, {x, y, degrees}}"}}

    Vision.Marks.table()
    |> Keyword.merge(
      height: {:number, 0.0, 100.0, "m"},
      at: [list, default: []],
      known: {:or, :all, list},
      robots:
        {:list,
         {:tuple, [{:integer, 0, 65_535}, {:check, &robot?/1, "a robot of this run"}],
          "{id, robot}"}}
    )
  end

  defp ball({_x, _y} = place), do: Type.read(@place, place)

  defp ball({_x, _y, _radius} = ball),
    do: Type.read({:tuple, @metres ++ [{:number, 0.03, 1.0, "m"}], "{x, y, radius}"}, ball)

  defp ball(_other), do: false

  defp box({_x, _y, _degrees} = pose), do: Type.read(@pose, pose)

  defp box({_x, _y, _degrees, _length, _width} = box) do
    sides = List.duplicate({:number, 0.1, 5.0, "m"}, 2)

    Type.read(
      {:tuple, List.duplicate({:number, -1.0e4, 1.0e4}, 3) ++ sides,
       "{x, y, degrees, length, width}"},
      box
    )
  end

  defp box(_other), do: false

  defp mission, do: Keyword.take(Landmark.Options.table(), Keyword.keys(@mission))

  # What its options say counts for all that looks at the run, too.
  defp named(%{mission: nil} = options), do: {:ok, options}

  defp named(%{mission: mission, robots: robots} = options) do
    with {:ok, {module, own} = mission} <- MissionRegistry.choose(mission, length(robots)) do
      shared = if module == Landmark, do: Map.new(Keyword.take(own, Keyword.keys(@mission)))
      {:ok, Map.merge(%{options | mission: mission}, shared || %{})}
    end
  end

  @doc "What is wrong with values of the table that each by itself does not show: names of robots that the run does not have, in its script, too."
  @spec problems(map()) :: [Type.problem()]
  def problems(%{robots: robots} = options) do
    cuts =
      "expected [{from_s, to_s, [[:mag1], [:mag2]]}] or " <>
        "[{from_s, :end, {:link, :mag1, :mag2}}], with robots of this run, got "

    kills =
      for {{who, _at_s} = kill, n} <- Enum.with_index(options.kills, 1),
          who not in [:leader | robots],
          do:
            {["kills", "#{n}"],
             "expected {robot, at_s} with a robot of this run, or :leader, got #{inspect(kill)}" <>
               Suggest.hint(inspect(who), robots)}

    starts =
      if is_list(options.start) and length(options.start) != length(robots),
        do: [
          {["start"],
           "expected a pose for each of #{length(robots)} robots, got #{length(options.start)}"}
        ],
        else: []

    cut? = Cuts.valid?(options.cuts, robots)

    if(cut?, do: [], else: [{["cuts"], cuts <> Wording.show(options.cuts)}]) ++
      starts ++ kills ++ Event.problems(options.script, robots)
  end

  @doc """
  The body of each robot. `given` names bodies for robots by what their names begin with: `rover: :kobuki` is that of `rover1`,
  and of two that fit the longer counts. A robot that none fits has the body with whose name, long or short, its own begins
  (`Robot.File.Bodies`). The error is one line.

      iex> {:ok, bodies} = Lab.Trial.Options.bodies([:burger1, :burger2], burger2: :kobuki)
      iex> for {id, body} <- bodies, do: {id, body.name}
      [burger1: :turtlebot3_burger, burger2: :kobuki]
  """
  @spec bodies([atom()], [{atom() | String.t(), atom() | String.t() | Profile.t()}] | map()) ::
          {:ok, %{atom() => Profile.t()}} | {:error, line :: String.t()}
  def bodies(robots, given) do
    given = for {key, body} <- given, do: {to_string(key), body}
    usual = for name <- Bodies.names(), do: {name, name}

    Enum.reduce_while(robots, {:ok, %{}}, fn id, {:ok, bodies} ->
      with {_name, body} <- longest(given, id) || longest(usual, id) || {nil, id},
           {:ok, body} <- body(body) do
        {:cont, {:ok, Map.put(bodies, id, body)}}
      else
        {:error, [line | _more]} -> {:halt, {:error, "the body of robot #{id}: #{line}"}}
      end
    end)
  end

  defp longest(named, id) do
    named
    |> Enum.filter(fn {name, _body} -> String.starts_with?("#{id}", name) end)
    |> Enum.max_by(fn {name, _body} -> byte_size(name) end, fn -> nil end)
  end

  defp body(%Profile{} = body), do: {:ok, body}
  defp body(name), do: Bodies.fetch(name)

  @doc "Whether robots have the floor plan, if that is not said: those that make a map themselves do not."
  @spec plan(term()) :: :none | :known
  def plan(nil), do: :known

  def plan(mission) do
    case MissionRegistry.choose(mission, nil) do
      {:ok, {module, _own}} -> if function_exported?(module, :map, 1), do: :none, else: :known
      {:error, _line} -> :known
    end
  end

  defp hardware(%{hardware: ids, robots: robots, bodies: bodies}) do
    cond do
      ids != Enum.uniq(ids) or ids -- robots != [] ->
        refuse(:hardware, ids, "a list of robots of this run, [:mag1],")

      id = Enum.find(ids, &(bodies[&1].rflex == nil and bodies[&1].board == nil)) ->
        {:error,
         "#{id} cannot be hardware: its body names no controller that is emulated on a serial line (rflex or board)"}

      true ->
        :ok
    end
  end

  defp refuse(key, value, allowed), do: Options.refuse("trial", [key], value, allowed)

  defp robots?([_ | _] = robots),
    do: Type.list?(robots) and Enum.all?(robots, &robot?/1) and robots == Enum.uniq(robots)

  defp robots?(_other), do: false

  defp duration?(seconds), do: is_number(seconds) and seconds >= 0 and seconds <= 1_000_000

  defp moves?(moves), do: Type.list?(moves) and Enum.all?(moves, &move?/1)

  defp move?({{x, y}, at_s}), do: is_number(x) and is_number(y) and is_number(at_s)
  defp move?(_other), do: false

  defp kills?(kills), do: Type.list?(kills) and Enum.all?(kills, &kill?/1)

  defp kill?({robot, at_s}), do: is_atom(robot) and is_number(at_s)
  defp kill?(_other), do: false

  defp ids?(ids), do: Type.list?(ids) and Enum.all?(ids, &is_atom/1)

  defp robot?(id), do: is_atom(id) and RobotName.valid?(id)

  # Resolved ones, too, so that checked options can be checked again.
  defp bodies?(%{} = bodies) when not is_struct(bodies), do: bodies |> Map.to_list() |> bodies?()

  defp bodies?(bodies),
    do: Type.keys?(bodies) and Enum.all?(bodies, fn {_key, body} -> body?(body) end)

  defp body?(body), do: RobotName.valid?(body) or is_struct(body, Profile)
end
