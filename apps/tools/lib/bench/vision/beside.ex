defmodule Bench.Vision.Beside do
  @moduledoc false
  # Runs a program of somebody else that searches the same frames in the same run, such as OpenCV from Python, or CMVision
  # where somebody has it.
  #
  # It is called as `PROGRAM FRAMES LIMITS WIDTH HEIGHT COUNT`: a file of COUNT yuyv frames, and one
  # with a line `ylow yhigh ulow uhigh vlow vhigh` for each class. It prints the microseconds that
  # each frame took, one a line. The smallest area is 20 pixels.

  # The classical pipeline, for each class; the planes are made once a frame. Four neighbours, as
  # in our backends.
  @opencv """
  import sys, time
  import cv2, numpy
  cv2.setNumThreads(1)
  frames, limits = sys.argv[1:3]
  width, height, count = map(int, sys.argv[3:6])
  data = numpy.fromfile(frames, numpy.uint8).reshape(count, height, width, 2)
  classes = [list(map(int, line.split())) for line in open(limits)]
  def search(frame):
      u = numpy.repeat(frame[:, 0::2, 1], 2, axis=1)
      v = numpy.repeat(frame[:, 1::2, 1], 2, axis=1)
      yuv = cv2.merge([numpy.ascontiguousarray(frame[:, :, 0]), u, v])
      found = []
      for k, (y0, y1, u0, u1, v0, v1) in enumerate(classes):
          mask = cv2.inRange(yuv, (y0, u0, v0), (y1, u1, v1))
          _n, _labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
          for s, c in zip(stats[1:], centres[1:]):
              if s[4] >= 20:
                  found.append((k, *s, *c))
      return sorted(found, key=lambda blob: (blob[0], -blob[5]))
  search(data[0])
  for frame in data:
      begun = time.perf_counter()
      search(frame)
      print((time.perf_counter() - begun) * 1e6)
  """

  @type program :: {Path.t(), arguments :: [String.t()]}

  @doc "OpenCV from Python, such as Debian's python3-opencv; `nil` if it is not here."
  @spec opencv() :: program() | nil
  def opencv do
    # Debian's package is for its own Python, which need not be the first one.
    pythons = Enum.uniq([System.find_executable("python3"), "/usr/bin/python3"])
    python = Enum.find(pythons, &opencv?/1)
    if python, do: {python, ["-c", @opencv]}
  end

  defp opencv?(nil), do: false

  defp opencv?(python) do
    File.exists?(python) and
      match?({_said, 0}, System.cmd(python, ["-c", "import cv2"], stderr_to_stdout: true))
  end

  @doc "Writes what a program needs to a folder, and returns its arguments."
  @spec write(Path.t(), Bench.Vision.work()) :: [String.t()]
  def write(folder, work) do
    frames = Path.join(folder, "#{work.name}.yuyv")
    limits = Path.join(folder, "#{work.name}.txt")
    File.write!(frames, work.copies)
    File.write!(limits, Enum.map(work.colours.classes, &line/1))
    [frame | _] = work.frames
    numbers = [frame.width, frame.height, length(work.copies)]
    [frames, limits | Enum.map(numbers, &Integer.to_string/1)]
  end

  @doc "Runs a program; its times in microseconds, or what it said."
  @spec run(program(), [String.t()]) :: {:ok, [float()]} | {:error, String.t()}
  def run({program, before}, arguments) do
    with {said, 0} <- System.cmd(program, before ++ arguments, stderr_to_stdout: true),
         [_ | _] = times <- times(said) do
      {:ok, times}
    else
      {said, status} when is_integer(status) -> {:error, "#{status}: #{String.trim(said)}"}
      [] -> {:error, "it printed no time"}
    end
  rescue
    error in [ErlangError, File.Error] -> {:error, Exception.message(error)}
  end

  @doc """
  The numbers of a text, one a line; `[]` if another line is among them.

      iex> Bench.Vision.Beside.times("13\\n12.5\\n")
      [13.0, 12.5]
      iex> Bench.Vision.Beside.times("13\\nwarning\\n")
      []
  """
  @spec times(String.t()) :: [float()]
  def times(text) do
    numbers = text |> String.split("\n", trim: true) |> Enum.map(&Float.parse/1)
    if Enum.all?(numbers, &match?({_time, ""}, &1)), do: Enum.map(numbers, &elem(&1, 0)), else: []
  end

  defp line(class) do
    [{y0, y1}, {u0, u1}, {v0, v1}] = [class.y, class.u, class.v]
    Enum.join([y0, y1, u0, u1, v0, v1], " ") <> "\n"
  end
end
