defmodule Console.Terminal.Table do
  @moduledoc "Lists the robots in a table that fits the screen. Pure."
  alias Console.Cli.{Condition, Format}
  alias Sim.Scene

  @width 36

  @doc "The table's width in characters."
  @spec width() :: pos_integer()
  def width, do: @width

  @doc "Exactly `rows` styled rows; the last one counts the robots that have no row."
  @spec draw(Scene.t(), pos_integer()) :: [[{String.t(), atom()}]]
  def draw(scene, rows) do
    robots = Enum.sort_by(scene.robots, &rank/1)
    room = max(rows - 1, 0)
    all = Enum.flat_map(robots, &rows/1)

    shown =
      if length(all) <= room do
        all
      else
        {shown, hidden} = Enum.split(robots, fitting(robots, max(room - 1, 0)))
        Enum.flat_map(shown, &rows/1) ++ [rest(hidden)]
      end

    Enum.take([heading() | shown] ++ List.duplicate([], rows), rows)
  end

  # How many of the first robots have room for all their rows.
  defp fitting(robots, room) do
    robots
    |> Enum.scan(0, &(length(rows(&1)) + &2))
    |> Enum.count(&(&1 <= room))
  end

  # One that is not sure of its place says why below.
  defp rows(%{state: :unsure, alive: true, says: "" <> why} = robot),
    do: [row(robot), [{short("  " <> why), :unsure}]]

  defp rows(robot), do: [row(robot)]

  defp short(text) do
    if String.length(text) > @width,
      do: String.slice(text, 0, @width - 1) <> "…",
      else: text
  end

  # The leader, then the robots that need attention, then the rest in the given order.
  defp rank(%{leader?: true}), do: 0
  defp rank(%{state: :blocked}), do: 1
  defp rank(%{state: :unsure}), do: 2
  defp rank(%{alive: false}), do: 4
  defp rank(_robot), do: 3

  defp heading, do: [{"  robot  does       off     ± sees %", :dim}]

  defp row(robot) do
    [
      {if(robot.leader?, do: "★ ", else: "  "), :leader},
      {String.pad_trailing("#{robot.id}", 7), name(robot)},
      {String.pad_trailing(does(robot), 9), state(robot)},
      {String.pad_leading(off(robot), 5), off_style(robot)},
      {String.pad_leading(within(robot), 6), within_style(robot)},
      {" ", :plain},
      sees(robot)
    ]
  end

  defp rest(hidden) do
    counts = Enum.frequencies_by(hidden, &does/1)
    text = Enum.map_join(counts, ", ", fn {does, count} -> "#{count} #{does}" end)
    [{"  … and #{length(hidden)}: #{text}", :dim}]
  end

  defp does(robot) do
    case Condition.of(robot) do
      [worst | _others] -> worst.word
      [] -> robot.state |> Atom.to_string() |> String.slice(0, 8)
    end
  end

  defp off(robot) do
    case Scene.slot_error(robot) do
      nil -> ""
      metres -> Format.decimals(metres, 2)
    end
  end

  defp off_style(robot) do
    case Scene.slot_error(robot) do
      metres when is_float(metres) and metres <= 0.25 -> :good
      _far_or_none -> :plain
    end
  end

  # The robot's own estimate, if it has one.
  defp within(%{alive: false}), do: ""
  defp within(%{uncertainty: nil}), do: ""
  defp within(%{uncertainty: metres}), do: "±" <> figure(metres)

  # Never wider than four characters.
  defp figure(metres) when metres < 9.995, do: Format.decimals(metres, 2)
  defp figure(metres) when metres < 99.95, do: Format.decimals(metres, 1)
  defp figure(metres), do: Format.decimals(min(metres, 9_999), 0)

  defp within_style(%{state: :unsure}), do: :unsure
  defp within_style(_robot), do: :dim

  defp sees(%{alive: false}), do: {"", :dim}
  defp sees(%{size_ppm: nil}), do: {"–", :dim}
  defp sees(%{size_ppm: ppm}), do: {"◆ #{Format.decimals(ppm / 10_000, 1)}", :landmark}

  defp name(%{alive: false}), do: :dead
  defp name(%{leader?: true}), do: :leader
  defp name(_robot), do: :name

  defp state(%{alive: false}), do: :dead
  defp state(%{state: :unsure}), do: :unsure
  defp state(robot), do: if(Condition.of(robot) == [], do: :plain, else: :bad)
end
