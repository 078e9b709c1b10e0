defmodule Vision.Blobs do
  @moduledoc """
  Finds the blobs in each frame of a picture, video, stream or camera, for `mix blobs`.
  """
  alias Hal.Camera.{FFmpeg, Source}
  alias Hal.Frame
  alias Vision.{Blob, Colours}

  @typedoc "One frame that was searched; `at_s` is its time in seconds since the first frame."
  @type seen :: %{
          number: non_neg_integer(),
          at_s: float(),
          frame: Frame.t(),
          blobs: [Blob.t()]
        }
  @typedoc "`odd` are remarks about the source, one line each, such as that its pictures have changed their size."
  @type summary :: %{
          frames: non_neg_integer(),
          blobs: non_neg_integer(),
          last: seen() | nil,
          odd: [String.t()]
        }

  @patience_ms 10_000

  @doc """
  Searches the frames of `source` and calls `report` with each `t:seen/0`; if that returns
  `:halt`, the result is `:halted`.

  Options: `:every` (1) searches only every n-th frame; `:frames` (no limit) ends after this many
  searched frames; `:patience_ms` (10,000) is the longest wait for a frame; `:unsafe` (`false`) also
  opens what `Hal.Camera.Source.refused/1` refuses.

  Of a file or a generator all frames are read, as fast as they are searched; of a device or
  stream, the newest. The error is one line. A source that ends after at least one frame is not an
  error.
  """
  @spec run(String.t(), Colours.t(), (seen() -> :halt | term()), keyword()) ::
          {:ok, summary()} | :halted | {:error, String.t()}
  def run(source, %Colours{} = colours, report, options \\ []) do
    options =
      Keyword.validate!(options, every: 1, frames: nil, patience_ms: @patience_ms, unsafe: false)

    job = Map.merge(Map.new(options), %{source: source, colours: colours, report: report})

    # A separate process has its own mailbox, and its end closes the camera.
    case unless(job.unsafe, do: Source.refused(source)) do
      nil -> fn -> look(job) end |> Task.async() |> Task.await(:infinity)
      why -> {:error, "#{source}: #{why}"}
    end
  end

  defp look(job) do
    # A killed port program is then an error to report, and does not end this process.
    Process.flag(:trap_exit, true)
    job = Map.put(job, :scratch, Vision.scratch(job.colours))
    summary = %{frames: 0, blobs: 0, last: nil, odd: []}
    open(job, %{number: 0, start_ms: nil, summary: summary})
  end

  defp open(job, progress) do
    every_frame? = Source.kind(job.source) in [:file, :generator]

    case FFmpeg.init(source: job.source, every: every_frame?, unsafe: job.unsafe) do
      {:ok, camera} -> next(camera, job, progress)
      {:error, reason} -> {:error, explain(job, reason)}
    end
  end

  defp odd(progress, line), do: update_in(progress.summary.odd, &Enum.uniq(&1 ++ [line]))

  defp next(camera, %{frames: limit}, %{summary: %{frames: limit} = summary}) do
    FFmpeg.terminate(camera)
    {:ok, summary}
  end

  defp next(camera, job, progress) do
    {:ok, camera} = FFmpeg.next(camera)
    wait(camera, job, progress)
  end

  defp wait(camera, job, progress) do
    receive do
      {:EXIT, caller, reason} when is_pid(caller) ->
        exit(reason)

      message ->
        case FFmpeg.handle_message(message, camera) do
          {:ok, [], camera} ->
            wait(camera, job, progress)

          {:ok, [{:frame, frame}], camera} ->
            take(frame, camera, job, progress)

          {:ok, [{:odd, line}], camera} ->
            wait(camera, job, odd(progress, line))

          {:error, :eof, _camera} ->
            {:ok, progress.summary}

          {:error, {:resized, _old, _new} = reason, camera} ->
            FFmpeg.terminate(camera)
            open(job, odd(progress, FFmpeg.explain(reason)))

          {:error, reason, _camera} ->
            {:error, explain(job, reason)}
        end
    after
      job.patience_ms ->
        FFmpeg.terminate(camera)
        {:error, "#{job.source}: no frame for #{job.patience_ms / 1000} s"}
    end
  end

  defp take(frame, camera, job, %{number: number} = progress) do
    start_ms = progress.start_ms || frame.at_ms
    further = %{progress | number: number + 1, start_ms: start_ms}

    if rem(number, job.every) == 0 do
      {:ok, blobs} = Vision.blobs(frame, job.colours, nil, job.scratch)
      seen = %{number: number, at_s: (frame.at_ms - start_ms) / 1000, frame: frame, blobs: blobs}

      case job.report.(seen) do
        :halt -> :halted
        _other -> next(camera, job, %{further | summary: add(progress.summary, seen)})
      end
    else
      next(camera, job, further)
    end
  end

  defp add(summary, seen) do
    %{
      summary
      | frames: summary.frames + 1,
        blobs: summary.blobs + length(seen.blobs),
        last: seen
    }
  end

  defp explain(job, reason), do: "#{job.source}: #{FFmpeg.explain(reason)}"
end
