defmodule Console.Page.Changes do
  @moduledoc false
  # Records what each robot of a fleet did, one line for each change of its state from scene to scene, and what the fleet tells of
  # it. Pure.
  #
  # A mesh tells such lines itself (`Console.Live.Mesh.View`).
  alias Console.Cli.Format
  alias Sim.Scene

  # Of each robot the newest are kept.
  @most 20

  defstruct at_ms: 0, states: %{}, lines: %{}

  @type t :: %__MODULE__{
          at_ms: integer(),
          states: %{atom() => atom() | String.t()},
          lines: %{atom() => [{at_s :: float(), line :: String.t()}]}
        }

  @doc """
  Looks at the next scene.

      iex> alias Console.Page.Changes
      iex> scene = fn at_ms, state -> %Sim.Scene{at_ms: at_ms, map: :hall, robots: [%{id: :mag1, state: state}]} end
      iex> changes = Enum.reduce([scene.(0, :search), scene.(100, :search), scene.(200, :lead)], %Changes{}, &Changes.note(&2, &1))
      iex> Changes.of(changes, scene.(300, :lead), :mag1)
      ["    0.0 s  search", "    0.2 s  lead"]
  """
  @spec note(t(), Scene.t()) :: t()
  def note(changes, %Scene{map: nil}), do: changes

  # A recording was turned back: what was to come is not known yet.
  def note(%{at_ms: before_ms}, %{at_ms: at_ms} = scene) when at_ms < before_ms,
    do: note(%__MODULE__{}, scene)

  def note(changes, scene) do
    changes = %{changes | at_ms: scene.at_ms}

    Enum.reduce(scene.robots, changes, fn %{id: id, state: state}, changes ->
      if changes.states[id] == state,
        do: changes,
        else: add(changes, id, state, scene.at_ms / 1000)
    end)
  end

  defp add(changes, id, state, at_s) do
    words = state |> to_string() |> String.replace("_", " ")
    line = {at_s, String.pad_leading(Format.decimals(at_s, 1), 7) <> " s  " <> words}
    lines = Enum.take([line | Map.get(changes.lines, id, [])], @most)

    %{
      changes
      | states: Map.put(changes.states, id, state),
        lines: Map.put(changes.lines, id, lines)
    }
  end

  @doc "The newest lines about a robot, the last the newest, with what this scene tells of it."
  @spec of(t(), Scene.t(), atom()) :: [String.t()]
  def of(changes, scene, robot) do
    told = for %{robot: ^robot} = stage <- scene.stages, do: {stage.at_s, Format.stage(stage)}

    (Enum.reverse(Map.get(changes.lines, robot, [])) ++ told)
    |> Enum.sort_by(&elem(&1, 0))
    |> Enum.take(-@most)
    |> Enum.map(&elem(&1, 1))
  end
end
