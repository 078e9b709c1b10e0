defmodule Vision.Marks.Schedule do
  @moduledoc """
  Says which part of a frame is searched for marks: all of it twice a second, and ten times a second boxes round the marks that
  were seen last, because a whole picture may take as long as a tick. Pure.
  """
  alias Vision.Mark

  @whole_ms 500
  @boxes_ms 100
  # A camera is not exact to the millisecond.
  @slack_ms 10
  # A box is twice as wide as its mark's square, and at least so many pixels to each side of its centre: a robot that turns at
  # 0.5 rad/s moves it by 28 pixels in 100 ms at 640 pixels across 60 degrees. What stands beside the square comes to that.
  @least_px 40

  defstruct whole_ms: nil, looked_ms: nil, marks: []

  @typedoc "When a whole frame was searched last, and when anything was; the marks of then."
  @type t :: %__MODULE__{
          whole_ms: integer() | nil,
          looked_ms: integer() | nil,
          marks: [Mark.t()]
        }

  @typedoc "The first column and row of a part of a frame, and those behind its last."
  @type box :: {non_neg_integer(), non_neg_integer(), pos_integer(), pos_integer()}

  @doc """
  The boxes of a frame of this size, taken now, that are to be searched; `:rest` if none is, and the marks seen last still hold.
  Boxes that overlap are one.

      iex> alias Vision.Marks.Schedule
      iex> Schedule.plan(%Schedule{}, 0, {640, 480})
      {:whole, [{0, 0, 640, 480}]}
      iex> Schedule.plan(%Schedule{whole_ms: 0, looked_ms: 0}, 100, {640, 480})
      {:boxes, []}
      iex> Schedule.plan(%Schedule{whole_ms: 0, looked_ms: 100}, 133, {640, 480})
      :rest
  """
  @spec plan(t(), at_ms :: integer(), {pos_integer(), pos_integer()}) ::
          {:whole | :boxes, [box()]} | :rest
  def plan(%__MODULE__{} = schedule, at_ms, {width, height} = size) do
    boxes = schedule.marks |> Enum.map(&around(&1, size)) |> Enum.sort() |> join()
    area = boxes |> Enum.map(fn {l, t, r, b} -> (r - l) * (b - t) end) |> Enum.sum()

    cond do
      due?(schedule.whole_ms, at_ms, @whole_ms) -> {:whole, [{0, 0, width, height}]}
      not due?(schedule.looked_ms, at_ms, @boxes_ms) -> :rest
      # It costs as much.
      area >= width * height -> {:whole, [{0, 0, width, height}]}
      true -> {:boxes, boxes}
    end
  end

  @doc "The schedule after the search of a plan in a frame of `at_ms`, which found these marks."
  @spec note(t(), :whole | :boxes, at_ms :: integer(), [Mark.t()]) :: t()
  def note(%__MODULE__{}, :whole, at_ms, marks),
    do: %__MODULE__{whole_ms: at_ms, looked_ms: at_ms, marks: marks}

  def note(%__MODULE__{} = schedule, :boxes, at_ms, marks),
    do: %{schedule | looked_ms: at_ms, marks: marks}

  # A clock that was set back makes no camera blind.
  defp due?(nil, _at_ms, _period_ms), do: true

  defp due?(last_ms, at_ms, period_ms),
    do: at_ms < last_ms or at_ms - last_ms >= period_ms - @slack_ms

  defp around(%Mark{x: x, y: y, corners: corners, family: family}, {width, height}) do
    {{left, right}, {top, bottom}} = Mark.bounds(corners)
    half = Enum.max([right - left, bottom - top, @least_px])
    beside = (Mark.code_end(family) - 0.5) * (right - left)

    {max(floor(x - half), 0), max(floor(y - half), 0), min(ceil(x + half + beside), width),
     min(ceil(y + half), height)}
  end

  defp join([]), do: []

  defp join([box | rest]) do
    case Enum.split_with(rest, &overlap?(box, &1)) do
      {[], rest} -> [box | join(rest)]
      {near, rest} -> join([Enum.reduce(near, box, &union/2) | rest])
    end
  end

  defp overlap?({l, t, r, b}, {left, top, right, bottom}),
    do: l < right and left < r and t < bottom and top < b

  defp union({l, t, r, b}, {left, top, right, bottom}),
    do: {min(l, left), min(t, top), max(r, right), max(b, bottom)}
end
