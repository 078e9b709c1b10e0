defmodule Console.Options do
  @moduledoc """
  Reads the options of `mix demo`, checked once when it starts. Pure. One table describes the options and makes the help
  text.
  """
  alias Console.Fleet
  alias Console.Options.Page
  alias Console.Cli.MapName
  alias Hal.Cli.Parse
  alias Console.Pace
  alias Hal.Options.Suggest
  alias Lab.Trial.WorldFile
  alias Sim.Floorplan.Maps
  alias Swarm.MissionRegistry

  defstruct robots: nil,
            seed: 1,
            map: "hall",
            bodies: [],
            marks: nil,
            world: nil,
            grey: :wall,
            start: :spread,
            landmark: :default,
            balls: [],
            boxes: [],
            moves: [],
            kills: [],
            loss: 0.0,
            noise: :default,
            mission: nil,
            formation: {:column, 1.0},
            assign: :cost,
            leader_change: true,
            duration_s: nil,
            blobs: :painted,
            page: 0,
            page_address: {127, 0, 0, 1},
            page_token: nil,
            page_origin: nil,
            services: [],
            plan: nil,
            headless: false,
            speed: nil,
            nodes: false,
            hardware: [],
            json: nil,
            picture: nil,
            save_map: nil,
            record: nil,
            incidents: nil,
            record_pictures: nil,
            trace: nil,
            csv: nil,
            help: false

  # The names of a mesh's nodes end there.
  @most_nodes 100

  @type t :: %__MODULE__{}

  # The maps without doors and corners, where a fleet needs less time.
  @short ~w(hall arena)

  @doc """
  Options from a command's arguments, or one line for each error in them. Names of files are
  relative to `folder`.

      iex> {:ok, options} = Console.Options.parse(~w(--robots 3 --landmark -2,1))
      iex> {options.robots, options.landmark}
      {[:mag1, :mag2, :min1], {-2.0, 1.0}}
      iex> Console.Options.parse(~w(--robots -3))
      {:error, [~s(--robots: expected a whole number from 1 to 1000, got "-3")]}
  """
  @spec parse([String.t()], Path.t()) :: {:ok, t()} | {:error, [String.t()]}
  def parse(arguments, folder \\ ".") do
    with {:ok, pairs} <- Hal.Cli.Arguments.parse(arguments, table(folder)),
         {:ok, options} <- fleet(pairs) do
      pairs
      |> Enum.reduce(options, &put/2)
      |> check_kills()
      |> check_mission()
      |> check_hardware()
      |> check_record()
      |> check_speed()
      |> check_page()
    end
  end

  @doc "The help text of `mix demo`."
  @spec help() :: String.t()
  def help do
    """
    A fleet of robots searches for a landmark, elects a leader and follows it in formation,
    or carries out another mission.

      bin/demo [options]        (or: mix demo [options])

    #{Hal.Cli.Arguments.help(table("."))}

    Examples
      bin/demo                                              six robots, live in the terminal
      bin/demo --robots 12 --formation wedge:1.2            twelve of them in a V
      bin/demo --robots 4 --mission patrol:period=90        four of them visit points for ever
      bin/demo --headless --kill leader@40 --seed 7         what happens when the leader dies?
      bin/demo --headless --move 3,2@40 --picture run.svg   the landmark moves away; see the paths
      bin/demo --headless --map hospital --json -           a report for another program
      bin/demo --map hospital --landmark 0,10.9             a landmark in another room: through the doors
      bin/demo --landmark none --ball -1,1 --mission 'chase:goal={3,0}' --robots 4
                                                            four of them bring a ball to a place
      bin/demo --speed 5                                    five times as fast; pause, step, speed max
      bin/demo --nodes --robots 4                           five processes: kill -9 one of them
      bin/demo --nodes --headless --kill leader@40 --json - the same with a report
      bin/demo --hardware 1                                 the first robot has the real drivers

    Exit status: 0 the fleet ended in formation (or as its mission wants it), or a person at a terminal has quit; 2 it did
    not; 1 something was wrong with the input, or the run ended before its time.
    """
  end

  @doc "The options for `Lab.Trial.new/1` and `Lab.Fleet.start_link/1`."
  @spec trial(t()) :: map()
  def trial(%__MODULE__{} = options) do
    options
    |> Map.take(
      ~w(robots seed map grey start landmark balls boxes moves kills loss noise formation assign leader_change blobs hardware)a
    )
    |> Map.merge(if options.world, do: Map.take(options, [:bodies, :marks]), else: %{})
    |> Map.put(:plan, plan(options))
    |> Map.put(:duration_s, duration_s(options))
    |> Map.merge(if options.mission, do: %{mission: options.mission}, else: %{})
    |> Map.merge(if options.nodes, do: %{nodes: true}, else: %{})
    |> Map.merge(if options.trace, do: %{trace: options.trace}, else: %{})
  end

  @doc """
  Whether the run must be in real time, because lockstep has no serial lines and no other
  processes.
  """
  @spec real_time?(t()) :: boolean()
  def real_time?(%__MODULE__{nodes: nodes?, hardware: hardware}), do: nodes? or hardware != []

  defp plan(%{plan: nil, mission: mission}), do: Lab.Trial.Options.plan(mission)
  defp plan(%{plan: plan}), do: plan

  @doc """
  How long the run may take, in simulated seconds.

      iex> Console.Options.duration_s(%Console.Options{map: "hospital"})
      180.0
  """
  @spec duration_s(t()) :: float()
  def duration_s(%__MODULE__{duration_s: nil, map: map}),
    do: if(map in (Maps.names() -- @short), do: 180.0, else: 120.0)

  def duration_s(%__MODULE__{duration_s: duration_s}), do: duration_s

  defp table(folder) do
    [
      {"robots", "N", &Parse.whole(&1, 1..1_000),
       "how many robots, 1 to 1000, half of them Magellans and half ATRV minis (6)"},
      {"fleet", "BODY:N,…", &Fleet.parse/1,
       "or how many of each body, such as burger:4,mag:2:\nmag (magellan), min (atrv_mini), burger, waffle (turtlebot3_…),\ncreate2, kobuki, pioneer3, or a file config/bodies/NAME.exs"},
      {"seed", "S", &Parse.whole(&1, 0..4_294_967_295),
       "of all randomness; the same seed gives the same run (1)"},
      {"map", "NAME", &MapName.parse(&1, folder),
       "#{MapName.names()},\nor FILE.yaml, or FILE.png:WIDTHxHEIGHT (or FILE.pgm) in metres (hall)"},
      {"world", "FILE.world", &world(&1, folder),
       "or walls, robots, landmark, balls and boxes of a world of Stage\n(instead of --map, --robots, --fleet and --start)"},
      {"grey", "HOW", &Parse.choice(&1, wall: :wall, floor: :floor),
       "what the grey of a picture is that seems to stand for what is unknown:\nwall, floor (wall)"},
      {"plan", "HOW", &Parse.choice(&1, none: :none, known: :known, sonar: :sonar),
       "whether robots have the floor plan (known), remember walls that their\nsonars saw (sonar), or do neither: known, sonar, none\n(known; with a mission that makes the map, such as explore: none)"},
      {"start", "HOW", &Parse.choice(&1, spread: :spread, same: :same),
       "spread over the map, or all switched on at one pose: same (spread)"},
      {"landmark", "X,Y|none", &landmark/1,
       "where the landmark stands, in metres (the middle, or the nearest\nroom that takes the fleet)"},
      {"ball", "X,Y", &Parse.point/1, "a ball, which robots can push, lies there; repeatable"},
      {"box", "X,Y,DEG", &box/1, "a box, which robots can push, stands there; repeatable"},
      {"move", "X,Y@T", &Parse.at(&1, fn text -> Parse.point(text) end, "X,Y@T"),
       "the landmark glides there from second T; repeatable"},
      {"kill", "WHO@T", &Parse.at(&1, fn text -> who(text) end, "leader@T or NAME@T"),
       "a robot dies at second T: leader, or a name; repeatable"},
      {"loss", "P", &Parse.number(&1, 0, 1), "share of radio messages lost, 0 to 1 (0)"},
      {"noise", "HOW", &Parse.choice(&1, off: :off, default: :default, slip: :slip),
       "of wheels and pictures: off, default, slip (default)"},
      {"mission", "NAME[:KEY=VALUE,…]", &{:ok, &1},
       "#{Parse.either(MissionRegistry.names())}, with options of it\n(#{hd(MissionRegistry.names() ++ ["none"])})"},
      {"formation", "KIND[:SPACING]", &Fleet.formation/1,
       "column, line, wedge, triangle, diamond or circle;\nspacing 0.8 to 5 m (column:1)"},
      {"assign", "HOW", &Parse.choice(&1, chain: :chain, cost: :cost),
       "who takes which place: chain by distance, or least cost (cost)"},
      {"leader-change", "on|off", &Parse.choice(&1, on: true, off: false),
       "whether another robot takes over when it sees better (on)"},
      {"duration", "S", &Parse.number(&1, 1, 3600),
       "simulated seconds at most (120 in hall, arena and a FILE,\n180 in other maps; live on a terminal: until you quit)"},
      {"headless", nil, nil,
       "no view, as fast as it goes (with --nodes or --hardware in real time)"},
      {"speed", "X|max", &Pace.speed/1,
       "live in lockstep, at X times real time (0.1 to 100) or as fast as it goes;
the prompt then takes pause, step, speed"},
      {"nodes", nil, nil,
       "each robot and the world in a process of its own, a node\nto attach to, to kill -9 and to kill -STOP"},
      {"hardware", "N|BODY:N,…", &hardware/1,
       "this many robots, or this many of each body, use the drivers of real ones\nand devices emulated on serial lines: of mag and min (0)"},
      {"json", "FILE|-", &file(&1, "", folder), "write the report (- is standard output)"},
      {"picture", "FILE.svg", &file(&1, ".svg", folder),
       "draw the paths and the formation error"},
      {"save-map", "FILE.yaml", &file(&1, ".yaml", folder),
       "write the map that the mission has made, as map_server does, with FILE.pgm\n(explore; with --headless, in lockstep)"},
      {"record", "FILE.mcap", &file(&1, ".mcap", folder),
       "record the run, for mix replay, Foxglove and others\n(not with --nodes)"},
      {"incidents", "DIR", &Parse.folder(&1, folder),
       "live: write the last minute of the robots into this folder after an emergency stop,
a fault or a crash, and at keep (not with --nodes)"},
      {"record-pictures", "RATE", &pictures/1,
       "also what the cameras see: RATE pictures a second of each robot,\n0.1 to 5 (none; with --record, needs ffmpeg)"},
      {"csv", "DIR", &Parse.folder(&1, folder),
       "write poses, errors, messages and ticks as tables\n(with --headless, in lockstep)"},
      {"page", "PORT|off", &page/1,
       "live, also in a browser: the port of the page, or none\n(any that is free)"}
    ] ++
      Page.table(folder) ++
      Page.services() ++
      [
        {"blobs", "HOW", &Parse.choice(&1, painted: :painted, direct: :direct),
         "paint camera pictures, or skip the painting (painted)"}
      ]
  end

  defp put({"fleet", _robots}, options), do: options
  defp put({"world", _file}, options), do: options
  defp put({"robots", _count}, options), do: options
  defp put({"move", move}, options), do: %{options | moves: options.moves ++ [move]}
  defp put({"ball", place}, options), do: %{options | balls: options.balls ++ [place]}
  defp put({"box", pose}, options), do: %{options | boxes: options.boxes ++ [pose]}
  defp put({"kill", kill}, options), do: %{options | kills: options.kills ++ [kill]}
  defp put({"duration", duration_s}, options), do: %{options | duration_s: duration_s}
  defp put({"page-token-file", token}, options), do: %{options | page_token: token}

  # The other names in the table are those of the struct, or of services.
  defp put({name, value}, options) do
    key = name |> String.replace("-", "_") |> String.to_existing_atom()

    if is_map_key(options, key),
      do: Map.replace!(options, key, value),
      else: %{options | services: Keyword.put(options.services, key, value)}
  end

  defp fleet(pairs) do
    case List.keyfind(pairs, "world", 0) do
      {_, file} -> world_fleet(file, pairs)
      nil -> named_fleet(pairs)
    end
  end

  # What the world's file says is there first, and other options change it or come to it.
  defp world_fleet(file, pairs) do
    with nil <- Enum.find(~w(robots fleet map start), &List.keymember?(pairs, &1, 0)),
         {:ok, world} <- WorldFile.open(file) do
      {:ok, struct!(%__MODULE__{world: world}, world.options)}
    else
      {:error, line} -> {:error, ["--world: #{line}"]}
      name -> {:error, ["--world and --#{name} exclude each other: the file says it itself"]}
    end
  end

  defp named_fleet(pairs) do
    case {List.keyfind(pairs, "robots", 0), List.keyfind(pairs, "fleet", 0)} do
      {{_, _}, {_, _}} -> {:error, ["--robots and --fleet exclude each other; give one of them"]}
      {_, {_, robots}} -> {:ok, %__MODULE__{robots: robots}}
      {{_, count}, nil} -> {:ok, %__MODULE__{robots: Fleet.of(count)}}
      {nil, nil} -> {:ok, %__MODULE__{robots: Fleet.of(6)}}
    end
  end

  # Names become robots of the fleet only by comparison: a text never becomes an atom.
  defp check_kills(options) do
    results = Enum.map(options.kills, &named(&1, options.robots))

    case for {:error, line} <- results, do: line do
      [] -> {:ok, %{options | kills: for({:ok, kill} <- results, do: kill)}}
      lines -> {:error, lines}
    end
  end

  # How many robots there are is known by now.
  defp check_mission({:ok, %{mission: nil}} = fine), do: fine

  defp check_mission({:ok, %{mission: text} = options}) do
    case MissionRegistry.Text.read(text, length(options.robots)) do
      {:ok, mission} -> {:ok, %{options | mission: mission}}
      {:error, line} -> {:error, ["--mission: #{line}"]}
    end
  end

  defp check_mission(error), do: error

  defp named({"leader", at_s}, _robots), do: {:ok, {:leader, at_s}}

  defp named({name, at_s}, robots) do
    case Enum.find(robots, &(Atom.to_string(&1) == name)) do
      nil ->
        hint = Suggest.hint(name, ["leader" | Enum.map(robots, &Atom.to_string/1)])

        {:error,
         "--kill names no robot: #{inspect(name)}; allowed are leader, #{Fleet.describe(robots)}#{hint}"}

      robot ->
        {:ok, {robot, at_s}}
    end
  end

  defp check_hardware({:ok, %{hardware: count} = options}) when is_integer(count) do
    if count <= length(options.robots),
      do: {:ok, %{options | hardware: Enum.take(options.robots, count)}},
      else: too_much_hardware("#{count}", options.robots)
  end

  defp check_hardware({:ok, %{hardware: robots} = options}) do
    case robots -- options.robots do
      [] -> {:ok, options}
      [missing | _] -> too_much_hardware("#{missing}", options.robots)
    end
  end

  defp check_hardware(error), do: error

  # A recorder hears the robots of its own process only; tables are made from the world of a run in lockstep.
  defp check_record({:ok, %{record: record, csv: csv, save_map: save_map} = options}) do
    lines =
      for {line, true} <- [
            {"--record cannot be used with --nodes: robots in processes of their own are not recorded",
             record != nil and options.nodes},
            {"--incidents is for robots that are processes of this run, without --nodes and --speed, and with --headless only with --hardware",
             options.incidents != nil and
               (options.nodes or options.speed != nil or
                  (options.headless and not real_time?(options)))},
            {"--nodes takes at most #{@most_nodes} robots, each in a process of its own",
             options.nodes and length(options.robots) > @most_nodes},
            {"--record-pictures needs --record FILE.mcap",
             options.record_pictures != nil and record == nil},
            {"--csv needs --headless, without --nodes and --hardware",
             csv != nil and (not options.headless or real_time?(options))},
            {"--save-map needs --headless, without --nodes and --hardware",
             save_map != nil and (not options.headless or real_time?(options))},
            {"--save-map needs a mission that makes a map, such as --mission explore",
             save_map != nil and not maps?(options.mission)}
          ],
          do: line

    if lines == [], do: {:ok, options}, else: {:error, lines}
  end

  defp check_record(other), do: other

  defp maps?({module, _own}), do: function_exported?(module, :map, 1)
  defp maps?(nil), do: false

  # Headless is as fast as it goes; lines and other processes go by the real clock.
  defp check_speed({:ok, %{speed: speed} = options}) do
    if speed == nil or not (options.headless or real_time?(options)),
      do: {:ok, options},
      else: {:error, ["--speed is for a live run, without --headless, --nodes and --hardware"]}
  end

  defp check_speed(other), do: other

  defp check_page({:ok, %{headless: true, services: [{name, _port} | _]}}),
    do: {:error, ["--#{name} is for a live run, without --headless"]}

  defp check_page({:ok, options}) do
    with {:error, line} <-
           Page.check(options.page_address, options.page_token, options.page_origin),
         do: {:error, [line]},
         else: (:ok -> {:ok, options})
  end

  defp check_page(other), do: other

  defp page("off"), do: {:ok, :off}

  defp page(text) do
    with {:error, allowed} <- Page.port(text), do: {:error, allowed <> ", or off,"}
  end

  defp too_much_hardware(asked, robots) do
    {:error,
     ["--hardware #{asked} is more than there are: the fleet is #{Fleet.describe(robots)}"]}
  end

  defp hardware(text) do
    with {:error, _allowed} <- Parse.whole(text, 0..100),
         {:error, _allowed} <- Fleet.parse(text) do
      {:error, {"a whole number, or such as mag:1,min:1,", kind_hint(text)}}
    end
  end

  # What people may type instead: a body without a number, or a robot's name.
  defp kind_hint(text) do
    kind = Hal.RobotName.kind(text)
    if kind in Robot.File.Bodies.names(), do: "; did you mean #{kind}:1?", else: ""
  end

  defp who(""), do: {:error, "a name"}
  defp who(text), do: {:ok, text}

  defp pictures(text) do
    {lowest, highest} = Lab.Recording.Pictures.rates()
    Parse.number(text, lowest, highest)
  end

  defp world(text, folder) do
    if text =~ ~r/.\.world\z/i,
      do: {:ok, MapName.from(text, folder)},
      else: {:error, "FILE.world"}
  end

  defp landmark("none"), do: {:ok, :none}

  defp landmark(text) do
    with {:error, allowed} <- Parse.point(text), do: {:error, allowed <> ", or none"}
  end

  defp box(text) do
    with [x, y, degrees] <- String.split(text, ","),
         {:ok, {x, y}} <- Parse.point("#{x},#{y}"),
         {:ok, degrees} <- Parse.number(String.trim(degrees), -360, 360),
         do: {:ok, {x, y, degrees}},
         else: (_other -> {:error, "X,Y,DEG in metres and degrees"})
  end

  defp file("-", "", _folder), do: {:ok, "-"}
  defp file("", _extension, _folder), do: {:error, "the name of a file"}

  defp file(text, extension, folder) do
    path = MapName.from(text, folder)

    cond do
      not String.ends_with?(path, extension) -> {:error, "a file whose name ends in #{extension}"}
      File.dir?(path) -> {:error, "a file, not a folder"}
      not File.dir?(Path.dirname(path)) -> {:error, "a file in a folder that exists"}
      true -> {:ok, path}
    end
  end
end
