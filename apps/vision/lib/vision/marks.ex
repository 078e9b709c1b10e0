defmodule Vision.Marks do
  @moduledoc """
  Finds printed marks with an id in frames: AprilTags of the families `tag36h11` (587 ids) and `tagStandard41h12` (2115
  ids), and self-similar marks with a barcode, `similar` (16 ids). All marks that a robot looks for are of one family, and of one size.

  AprilTags need Debian's `libapriltag-dev` when the project is built, and `libapriltag3` when it runs: `available/1`. `mix mark`
  prints marks.
  """
  alias Hal.Frame
  alias Vision.Mark
  alias Vision.Marks.{Native, Picture, Pose, Schedule, Similar}

  @families [:tag36h11, :tagStandard41h12, :similar]
  # Marks with less contrast between their cells, in grey levels of 255, are left out.
  @least_margin 5.0
  # What the searches read: formats, and sizes as in marks.h.
  @formats [:yuyv, :i420, :nv12]
  @least 16
  @most 32_767
  # A corner that was nearer to the edge of the frame made a range 4 % too long.
  @edge_px 3.0

  @enforce_keys [:family, :size]
  defstruct @enforce_keys

  @typedoc "What is looked for: the family, and the side of the square between the corners in metres."
  @type t :: %__MODULE__{family: Mark.family(), size: float()}

  @typedoc "What the search for marks of a family needs."
  @opaque detector :: :similar | Native.detector()

  @doc "The options of `new/1`, as a table of `Hal.Options`."
  @spec table() :: Hal.Options.table()
  def table do
    [
      family: [{:one_of, @families}, default: :tag36h11],
      size: [{:number, 0.01, 10.0, "m"}, required: true]
    ]
  end

  @doc """
  What is to be looked for; the error is one line.

      iex> Vision.Marks.new(size: 0.16)
      {:ok, %Vision.Marks{family: :tag36h11, size: 0.16}}
      iex> {:error, line} = Vision.Marks.new(family: :tag16h5, size: 0.16)
      iex> line =~ "tag36h11, :tagStandard41h12 or :similar"
      true
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, line :: String.t()}
  def new(options) do
    with {:ok, options} <- Hal.Options.check(options, table(), "marks"),
         do: {:ok, struct!(__MODULE__, options)}
  end

  @doc "All families."
  @spec families() :: [Mark.family(), ...]
  def families, do: @families

  @doc "How many ids a family has, from 0."
  @spec ids(Mark.family()) :: pos_integer()
  def ids(:tag36h11), do: 587
  def ids(:tagStandard41h12), do: 2115
  def ids(:similar), do: Similar.Pattern.ids()

  @doc "Whether marks of a family can be found and drawn here, or in one line why not."
  @spec available(Mark.family()) :: :ok | {:error, line :: String.t()}
  def available(family \\ :tag36h11)
  def available(:similar), do: :ok

  def available(_apriltag) do
    if Native.loaded?(),
      do: :ok,
      else:
        {:error,
         "there is no libapriltag: install libapriltag-dev, and compile again (mix compile)"}
  end

  @doc "The picture of a mark of a family that is available; `nil` if it has no such id."
  @spec picture(Mark.family(), Mark.id()) :: Picture.t() | nil
  def picture(:similar, id), do: Similar.Pattern.picture(id)

  def picture(family, id) do
    with {_cells, _border, _bits} = picture <- Native.picture(family, id),
         do: Picture.square(picture)
  end

  @doc "What the process that calls this needs for `look/4`, once; the error is that of `available/1`."
  @spec detector(t()) :: {:ok, detector()} | {:error, line :: String.t()}
  def detector(%__MODULE__{family: :similar}), do: {:ok, :similar}

  def detector(%__MODULE__{family: family}) do
    with :ok <- available(family), do: {:ok, Native.detector(family)}
  end

  @doc """
  The marks that hold in a frame, by id and then from the left, and the schedule for the next frame. Marks at the edge of the
  frame are left out. The error is `{:format, format}`, `{:size, size}` or `:memory`. Where the schedule has
  nothing searched in this frame, they are those of the last search, with its `at_ms`.
  """
  @spec look(t(), detector(), Schedule.t(), Frame.t()) ::
          {:ok, [Mark.t()], Schedule.t()} | {:error, term()}
  def look(%__MODULE__{} = marks, detector, %Schedule{} = schedule, %Frame{} = frame) do
    with {part, boxes} <- Schedule.plan(schedule, frame.at_ms, {frame.width, frame.height}),
         {:ok, found} <- search(boxes, detector, frame, []) do
      seen =
        for {id, _wrong_bits, margin, {x, y}, corners} <- Enum.sort_by(found, &place/1),
            margin >= @least_margin,
            {:ok, mark} <- [reading(marks, id, corners, frame)],
            do: %{mark | x: x, y: y}

      {:ok, seen, Schedule.note(schedule, part, frame.at_ms, seen)}
    else
      :rest -> {:ok, schedule.marks, schedule}
      error -> error
    end
  end

  @doc "All marks of a frame, whatever was seen before."
  @spec find(t(), detector(), Frame.t()) :: {:ok, [Mark.t()]} | {:error, term()}
  def find(%__MODULE__{} = marks, detector, %Frame{} = frame) do
    with {:ok, seen, _schedule} <- look(marks, detector, %Schedule{}, frame), do: {:ok, seen}
  end

  defp search(_boxes, _detector, %Frame{format: format}, _found) when format not in @formats,
    do: {:error, {:format, format}}

  defp search(_boxes, _detector, %Frame{width: width, height: height}, _found)
       when width > @most or height > @most,
       do: {:error, {:size, {width, height}}}

  defp search([], _detector, _frame, found), do: {:ok, found}

  # So small a part shows nothing.
  defp search([{left, top, right, bottom} | boxes], detector, frame, found)
       when right - left < @least or bottom - top < @least,
       do: search(boxes, detector, frame, found)

  defp search([{left, top, _, _} = box | boxes], detector, frame, found) do
    with {:ok, more} <- search_box(detector, frame, box) do
      move = fn {x, y} -> {x + left, y + top} end

      moved =
        for {id, wrong_bits, margin, centre, corners} <- more,
            do: {id, wrong_bits, margin, move.(centre), Enum.map(corners, move)}

      search(boxes, detector, frame, moved ++ found)
    end
  end

  defp search_box(:similar, frame, box), do: Similar.search(frame, box)
  defp search_box(detector, frame, box), do: Native.search(detector, frame, box)

  @doc """
  The mark with this id whose corners are there in a frame, by what is known of the frame: its size, when and how it was taken.
  `:edge` if a corner is too near to the edge of it.
  """
  @spec reading(t(), id :: non_neg_integer(), [Mark.point(), ...], frame :: map()) ::
          {:ok, Mark.t()} | :edge
  def reading(%__MODULE__{} = marks, id, corners, %{width: width, height: height} = frame) do
    if Enum.all?(corners, &clear?(&1, width, height)) do
      {x, y} = centre(corners)

      mark = %Mark{
        family: marks.family,
        id: id,
        at_ms: frame.at_ms,
        x: x,
        y: y,
        corners: corners,
        width: width,
        height: height
      }

      {:ok, struct!(mark, placed(corners, frame, marks.size))}
    else
      :edge
    end
  end

  defp place({id, _wrong_bits, _margin, centre, _corners}), do: {id, centre}

  defp clear?({x, y}, width, height) do
    x >= @edge_px and y >= @edge_px and x <= width - 1 - @edge_px and
      y <= height - 1 - @edge_px
  end

  # Where the diagonals cross.
  defp centre([{x0, y0}, {x1, y1}, {x2, y2}, {x3, y3}]) do
    {ax, ay, bx, by} = {x2 - x0, y2 - y0, x3 - x1, y3 - y1}
    t = ((x1 - x0) * by - (y1 - y0) * bx) / (ax * by - ay * bx)
    {x0 + t * ax, y0 + t * ay}
  end

  defp placed(_corners, %{field_of_view: nil}, _size), do: %{}

  defp placed(corners, frame, size) do
    camera = %{frame | pan: frame.pan || 0.0, tilt: frame.tilt || 0.0}
    Pose.reading(corners, camera, size) || %{}
  end
end
