defmodule Missions.Landmark.Signs do
  @moduledoc """
  Lets printed marks choose the formation: a leader that reads a mark in three frames in a row takes the formation that the option
  `formations:` gives to its id, as if a person had asked for it, and says so with the stage `sign`. Pure.

  Of several marks in one frame the nearest counts. The last one decides until another is seen, so what a person asks for meanwhile
  stays, although the mark is still in sight.
  """
  alias Missions.Landmark
  alias Missions.Landmark.Leader
  alias Swarm.Formation
  alias Vision.Mark
  alias Vision.Marks.Streaks

  @enforce_keys [:formations]
  defstruct @enforce_keys ++ [streaks: %{}, at_ms: nil, last: nil]

  @typedoc "What was read, until which frame, and which mark decided last."
  @type t :: %__MODULE__{
          formations: %{Mark.id() => Formation.t()},
          streaks: Streaks.t(),
          at_ms: integer() | nil,
          last: Mark.id() | nil
        }

  @doc "The signs of the option `formations:`; `nil` for none."
  @spec new([{Mark.id(), Formation.t()}]) :: t() | nil
  def new([]), do: nil
  def new(formations), do: %__MODULE__{formations: Map.new(formations)}

  @doc "The mission after it has read its newest frame, and what it tells."
  @spec read(Landmark.State.t()) :: {Landmark.State.t(), [tuple()]}
  def read(%{signs: nil} = mission), do: {mission, []}
  def read(%{percept: %{detections: nil}} = mission), do: {mission, []}

  def read(%{signs: %{at_ms: at_ms}, percept: %{detections: %{at_ms: at_ms}}} = mission),
    do: {mission, []}

  def read(%{signs: signs, percept: %{detections: detections}} = mission) do
    {read, streaks} = Streaks.note(signs.streaks, detections.marks, detections.at_ms)
    signs = %{signs | streaks: streaks, at_ms: detections.at_ms}
    known = for mark <- read, is_map_key(signs.formations, mark.id), do: mark

    case Enum.min_by(known, &{&1.range || 0.0, &1.id}, fn -> nil end) do
      %{id: id} when mission.phase == :lead and id != signs.last ->
        obey(%{mission | signs: %{signs | last: id}}, id)

      _none_or_known ->
        {%{mission | signs: signs}, []}
    end
  end

  defp obey(%{signs: signs, formation: before} = mission, id) do
    case Map.fetch!(signs.formations, id) do
      ^before ->
        {mission, []}

      {kind, spacing} = formation ->
        says = "sees mark #{id}, and asks for #{kind} #{spacing}"
        {Leader.reshape(mission, formation), [{:stage, :sign, %{says: says, mark: id}}]}
    end
  end
end
