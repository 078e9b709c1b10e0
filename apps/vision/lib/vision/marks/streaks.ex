defmodule Vision.Marks.Streaks do
  @moduledoc """
  Says which marks were read in three frames in a row, because what acts on a mark should not act on one picture. Pure.

  A frame in which no mark was searched for (`Vision.Marks.Schedule`) ends no streak. An id that is read twice in one frame counts
  as none: it is not known which of the two is meant.
  """
  alias Vision.Mark

  @frames 3

  @typedoc "In how many frames in a row each id was read."
  @type t :: %{Mark.id() => pos_integer()}

  @doc """
  Those of the marks that hold in a frame of `at_ms` (`Vision.Detections`) which were read in it and in the two before, by id, and the
  streaks after it. `nil` is a frame of a camera that looks for none.

      iex> mark = %Vision.Mark{family: :tag36h11, id: 7, at_ms: 0, x: 9.0, y: 9.0, corners: [], width: 20, height: 20}
      iex> frame = &[%{mark | at_ms: &1}]
      iex> {[], streaks} = Vision.Marks.Streaks.note(%{}, frame.(0), 0)
      iex> {[], streaks} = Vision.Marks.Streaks.note(streaks, frame.(100), 100)
      iex> {[read], _streaks} = Vision.Marks.Streaks.note(streaks, frame.(200), 200)
      iex> {read.id, read.at_ms}
      {7, 200}
  """
  @spec note(t(), [Mark.t()] | nil, at_ms :: integer()) :: {[Mark.t()], t()}
  def note(streaks, nil, _at_ms), do: {[], streaks}

  def note(streaks, marks, at_ms) do
    {fresh, held} = Enum.split_with(marks, &(&1.at_ms == at_ms))
    alone = for {_id, [mark]} <- Enum.group_by(fresh, & &1.id), do: mark
    read = Map.new(alone, &{&1.id, Map.get(streaks, &1.id, 0) + 1})
    kept = Map.take(streaks, Enum.map(held, & &1.id))

    {for(mark <- Enum.sort_by(alone, & &1.id), read[mark.id] >= @frames, do: mark),
     Map.merge(kept, read)}
  end
end
