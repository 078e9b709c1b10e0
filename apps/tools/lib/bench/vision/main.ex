defmodule Bench.Vision.Main do
  @moduledoc "Runs the command `mix bench vision`: reads its options, measures, prints the table."
  alias Bench.{Command, Load, Vision}
  alias Console.Cli.Output
  alias Hal.Cli.Parse

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "vision", table(), &measure/1)

  defp measure(given), do: Command.in_folder("vision", &measure(given, &1))

  defp measure(given, folder) do
    rounds = Map.get(given, "rounds", 40)
    classes = Map.get(given, "classes", 8)
    kinds = Map.get(given, "frames", Keyword.keys(Vision.kinds()))
    plan = Map.merge(plan(given["beside"]), %{rounds: rounds, classes: classes, folder: folder})
    photo = Map.get_lazy(given, "photo", &photo/0)

    {measured, about} =
      Command.loaded(fn output ->
        for {kind, n} <- Enum.with_index(kinds) do
          named = "frames: #{Vision.kinds()[kind]}"
          all = length(kinds) * rounds
          {kind, one(kind, photo, plan, &Command.progress(output, n * rounds + &1, all, named))}
        end
      end)

    about = Map.merge(about, %{rounds: rounds, classes: classes})
    IO.write(Vision.Report.draw(plan.ways, measured))
    IO.puts("\n" <> words(about))
    json = Output.json(given["json"], Vision.Report.term(plan.ways, measured, about))
    failed = failed(measured, given["frames"] || given["photo"])
    if failed == [], do: json, else: {:error, failed}
  end

  defp one(kind, photo, plan, note) do
    case Vision.work(kind, photo, plan.classes) do
      {:ok, work} ->
        Vision.Runner.run(work, plan.ways, plan.programs, plan.folder, plan.rounds, note)

      {:error, why} ->
        {:absent, why}
    end
  end

  # What was asked for by name; a photograph that is not there is left out otherwise.
  defp failed(measured, asked?) do
    frames = for {kind, {:absent, why}} <- measured, asked?, do: "#{kind}: #{why}"
    frames ++ for {kind, %{beside: {:absent, why}}} <- measured, do: "--beside, #{kind}: #{why}"
  end

  defp plan(nil), do: %{ways: Vision.ways(), programs: %{opencv: Vision.Beside.opencv()}}

  defp plan(program) do
    plan = plan(nil)
    way = %{name: :beside, says: Path.basename(program), pace: :slow}
    %{ways: plan.ways ++ [way], programs: Map.put(plan.programs, :beside, {program, []})}
  end

  defp photo, do: Path.join(System.get_env("CONVOY_PHOTOS", "_build/opencv-doc"), "fruits.jpg")

  defp words(about) do
    {width, height, copies} = Vision.Frames.size()

    "#{width}x#{height} yuyv, #{about.classes} classes, #{copies} rolled copies in turn; the median of #{about.rounds} rounds, in each " <>
      "of which each way searches all copies. Ratios to the kernel in the same round.\n#{Load.words(about)}."
  end

  defp table do
    kinds = for {kind, _says} <- Vision.kinds(), do: %{name: kind}

    [
      {"rounds", "N", &Parse.whole(&1, 1..10_000), "how often each is measured (40)"},
      {"frames", "NAME,NAME", &kinds(&1, kinds), "which frames (easy,speckle,photograph)"},
      {"classes", "N", &Parse.whole(&1, 8..32),
       "so many classes: a frame's own eight, then others of a grid (8)"},
      {"photo", "FILE", &{:ok, &1}, "the photograph (fruits.jpg of bin/opencv-data)"},
      {"beside", "PROGRAM", &program/1,
       "a program that searches the same frames: PROGRAM FRAMES LIMITS WIDTH\nHEIGHT COUNT prints a line of microseconds for each"},
      {"json", "FILE", &{:ok, &1}, "write the figures there too"}
    ]
  end

  defp kinds(text, kinds) do
    with {:ok, chosen} <- Parse.named(text, kinds), do: {:ok, Enum.map(chosen, & &1.name)}
  end

  defp program(text) do
    case System.find_executable(text) do
      nil -> {:error, "the path of a program"}
      path -> {:ok, path}
    end
  end
end
