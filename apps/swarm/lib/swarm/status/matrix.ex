defmodule Swarm.Status.Matrix do
  @moduledoc """
  Shows which robot hears which. In `iex` it prints as a table, with a line for each robot and a column
  for each robot that it may hear:

      #Swarm.Status.Matrix, 3 robots
              mag1  mag2  min1  view
        mag1     .     x     -  4: mag1 mag2
        mag2     x     .     x  7: mag1 mag2 min1
        min1     -     x     .  3: mag2 min1, 800 ms ago

  `x` means heard, `-` not heard, `?` unknown: that robot does not answer, and its row has not
  arrived.
  """
  alias Swarm.Status

  @enforce_keys [:robots, :lines]
  defstruct @enforce_keys

  @type line :: %{hears: [atom()], view: Status.view() | nil, age_ms: non_neg_integer() | nil}
  @type t :: %__MODULE__{robots: [atom()], lines: %{atom() => line()}}

  @doc """
  The matrix of robots of this status.

      iex> a = %Swarm.Status{robot: :mag1, hears: [:mag2], view: {1, [:mag1, :mag2]}}
      iex> Swarm.Status.Matrix.new([a, %Swarm.Status{robot: :mag2, state: :no_answer}]) |> inspect()
      "#Swarm.Status.Matrix, 2 robots\\n        mag1  mag2  view\\n  mag1     .     x  1: mag1 mag2\\n  mag2     ?     .  "
  """
  @spec new([Status.t()]) :: t()
  def new(status) do
    lines =
      for %Status{state: state} = one <- status, state != :no_answer, into: %{} do
        age_ms = if one.from == :row, do: one.age_ms
        {one.robot, %{hears: one.hears, view: one.view, age_ms: age_ms}}
      end

    robots = Enum.map(status, & &1.robot) ++ Enum.flat_map(lines, fn {_, line} -> line.hears end)
    %__MODULE__{robots: robots |> Enum.uniq() |> Enum.sort(), lines: lines}
  end

  @doc "Whether one robot hears another; `:unknown` if it says nothing."
  @spec hears?(t(), atom(), atom()) :: boolean() | :unknown
  def hears?(matrix, from, to) do
    case matrix.lines do
      %{^from => %{hears: hears}} -> to in hears
      _silent -> :unknown
    end
  end

  defimpl Inspect do
    def inspect(%{robots: robots} = matrix, _options) do
      wide = robots |> Enum.map(&String.length("#{&1}")) |> Enum.max(fn -> 0 end)
      cell = fn text -> String.pad_leading("#{text}", wide + 2) end
      head = "  " <> String.duplicate(" ", wide) <> Enum.map_join(robots, cell) <> "  view"

      lines =
        for from <- robots do
          marks = Enum.map_join(robots, &cell.(mark(matrix, from, &1)))

          "  " <>
            String.pad_trailing("#{from}", wide) <> marks <> "  " <> view(matrix.lines[from])
        end

      Enum.join(["#Swarm.Status.Matrix, #{length(robots)} robots", head | lines], "\n")
    end

    defp mark(_matrix, one, one), do: "."

    defp mark(matrix, from, to) do
      case Swarm.Status.Matrix.hears?(matrix, from, to) do
        true -> "x"
        false -> "-"
        :unknown -> "?"
      end
    end

    defp view(%{view: {number, members}} = line),
      do: "#{number}: #{Enum.join(members, " ")}" <> age(line.age_ms)

    defp view(_unknown), do: ""
    defp age(nil), do: ""
    defp age(ms), do: ", #{ms} ms ago"
  end
end
