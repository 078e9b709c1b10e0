defmodule Mix.Tasks.Bench do
  @shortdoc "Measures the demo over many seeds, the swarm beside bare OTP, how fast robots stop and see"
  @moduledoc """
  `mix bench demo` runs the cases of the landmark mission over many seeds and prints a table in
  Markdown.

  Two runs go at a time. All figures except the speed are the same on every machine.

  `mix bench goto` measures how well a robot with the floor plan gets from anywhere to anywhere.

  `mix bench explore` measures how long robots take to see a building that they do not know, one and four.

  `mix bench swarm` measures robots that are nodes of their own on this machine, beside bare OTP:
  how long it takes to ask all, to find each other, to notice a death.

  `mix bench stop` measures how long it takes from a crash, a freeze, a bumper or an emergency
  stop to the stop on the serial line of a base.

  `mix bench bases` measures what the wheels of each kind of base do when what commands them is killed, frozen or silent,
  and when the cable is pulled.

  `mix bench vision` measures how long a frame takes in the native backend, with and without the
  call from Elixir, beside a copy of the frame and the other backends.

  `mix bench marks` measures in how many pictures marks are found, in how many one is seen that is not there, and how wrong
  their places are; with `--round MAP`, how far off robots are that know where marks hang, and such that do not.

  `mix bench scale` measures what a robot costs in fleets of different sizes, as a table and as bars.

  `mix bench page` measures what the page costs a fleet, with browsers that read and with some that do not.

  `mix bench recording` measures what a recording costs a run. All have `--help`. Exit status: 0 if all was
  measured, 1 if the input was wrong or a run could not be made.
  """
  use Mix.Task
  alias Console.Cli.MapName
  alias Hal.Cli.Parse

  @commands %{
    "goto" => Bench.Goto.Main,
    "explore" => Bench.Explore.Main,
    "swarm" => Bench.Mesh.Main,
    "stop" => Bench.Stop.Main,
    "bases" => Bench.Bases.Main,
    "vision" => Bench.Vision.Main,
    "marks" => Bench.Marks.Main,
    "scale" => Bench.Scale.Main,
    "page" => Bench.Page.Main,
    "recording" => Bench.Recording.Main
  }

  @impl Mix.Task
  def run(arguments), do: Hal.Cli.Command.guard("bench", fn -> bench(arguments) end)

  defp bench(["demo" | arguments]) do
    Hal.Cli.Command.update()

    with {:ok, pairs} <- Hal.Cli.Arguments.parse(arguments, table()),
         {:ok, given} <- of_mission(Map.new(pairs)) do
      measure(given)
    else
      {:error, lines} -> refuse(lines)
    end
  end

  defp bench([name | arguments]) when is_map_key(@commands, name) do
    Hal.Cli.Command.update()
    with {:error, lines} <- @commands[name].run(arguments), do: refuse(lines)
  end

  defp bench(arguments) when arguments in [["--help"], ["-h"]], do: help()

  defp bench(_other),
    do:
      refuse([
        "mix bench needs a command: mix bench demo [options], mix bench goto [options], mix bench explore [options], " <>
          "mix bench swarm [options], mix bench stop [options], mix bench bases [options], mix bench vision [options], mix bench marks [options], mix bench scale [options], mix bench page [options], mix bench recording [options]"
      ])

  defp of_mission(%{"mission" => mission} = given) do
    cases = Bench.of_any_mission(Map.get(given, "cases", Bench.cases()))

    if cases == [] do
      names = Bench.cases() |> Bench.of_any_mission() |> Enum.map_join(", ", & &1.name)
      {:error, ["--cases names none that a mission of your own can be measured in: #{names}"]}
    else
      with {:ok, mission} <- mission(mission, cases) do
        cases = for case <- cases, do: put_in(case.options[:mission], mission)
        {:ok, Map.put(given, "cases", cases)}
      end
    end
  end

  defp of_mission(given), do: {:ok, given}

  # Each case checks the options again, with its own number of robots.
  defp mission(text, cases) do
    fewest = cases |> Enum.map(&Map.get(&1.options, :robots, 6)) |> Enum.min()

    case Swarm.MissionRegistry.Text.read(text, fewest) do
      {:ok, mission} -> {:ok, mission}
      {:error, line} -> {:error, ["--mission: #{line}"]}
    end
  end

  defp measure(%{"help" => true}), do: help()

  defp measure(given) do
    cases =
      given
      |> Map.get("cases", Bench.cases())
      |> with_option(:landmark, given["landmark"])
      |> with_option(:plan, given["plan"])

    maps = Map.get(given, "maps", ["hall", "hospital"])
    seeds = Map.get(given, "seeds", 1..40)
    blobs = Map.get(given, "blobs", :painted)
    jobs = for case <- cases, map <- maps, seed <- seeds, do: {case, map, seed}

    named = fn {case, map, seed} -> "#{case.name} in #{map}, seed #{seed}" end

    run = fn {case, map, seed} -> Bench.Run.run(case, map, seed, blobs, Lab.Trial) end
    results = Bench.Command.each(jobs, run, named)
    failed = for {job, {:error, line}} <- results, do: "#{named.(job)}: #{line}"
    rows = rows(results, cases, maps)
    text = Bench.Table.draw(rows) <> "\n" <> Bench.Table.pooled(rows)
    IO.write(text)
    write(given["markdown"], text)
    # The table does not hold all that was asked for.
    if failed != [], do: refuse(failed)
  end

  defp with_option(cases, _key, nil), do: cases
  defp with_option(cases, key, value), do: Enum.map(cases, &put_in(&1.options[key], value))

  defp rows(results, cases, maps) do
    for case <- cases,
        map <- maps,
        runs = for({{^case, ^map, _seed}, {:ok, run}} <- results, do: run),
        runs != [],
        do: {"#{case.name}: #{case.says}", map, Bench.limit_s(case, map), runs}
  end

  defp write(nil, _text), do: :ok

  defp write(path, text) do
    with {:error, reason} <- File.write(path, text),
         do: refuse(["--markdown #{path} cannot be written: #{:file.format_error(reason)}"])
  end

  defp table do
    [
      {"seeds", "A-B", &Parse.span(&1, 0..100_000), "which seeds (1-40)"},
      {"cases", "NAME,NAME", &Bench.choose/1, "which cases (all)"},
      {"mission", "NAME[:KEY=VALUE,…]", &{:ok, &1},
       "#{Parse.either(Swarm.MissionRegistry.names())}: measured is when each robot first claims that it has\nwhat its mission wants (#{hd(Swarm.MissionRegistry.names() ++ ["none"])})"},
      {"landmark", "none", &Parse.choice(&1, none: :none),
       "none stands anywhere (it stands in the middle, or in the nearest room\nthat takes the fleet, and is an obstacle)"},
      {"plan", "HOW", &Parse.choice(&1, known: :known, sonar: :sonar, none: :none),
       "what robots know of walls: the floor plan (known), what their sonars have\nseen (sonar), or nothing (none)"},
      {"maps", "NAME,NAME", &MapName.list/1,
       "which maps: names, FILE.yaml, FILE.png:WIDTHxHEIGHT or FILE.pgm:…\n(hall,hospital)"},
      {"blobs", "HOW", &Parse.choice(&1, painted: :painted, direct: :direct),
       "painted or direct (painted)"},
      {"markdown", "FILE", &{:ok, &1}, "write the table there too"}
    ]
  end

  defp help do
    cases = Enum.map_join(Bench.cases(), "\n", &"  #{String.pad_trailing(&1.name, 18)}#{&1.says}")
    IO.puts("  mix bench demo [options]\n\n#{Hal.Cli.Arguments.help(table())}\n\nCases\n#{cases}")
  end

  defp refuse(lines), do: Hal.Cli.Command.refuse("bench", lines)
end
