defmodule Mix.Tasks.Blobs do
  @shortdoc "Finds coloured blobs in a picture, video, stream or camera"
  @moduledoc """
  Finds coloured blobs in a picture, video, stream or camera.

      mix blobs SOURCE --colours FILE [options]

  SOURCE is a picture or video file, a stream (`rtsp://…`), a camera (`/dev/video0`), `testsrc`
  (ffmpeg's test picture, 50 frames of it) or `lavfi:GENERATOR` (another generator of ffmpeg, such
  as `lavfi:testsrc2=size=64x48`).

  `--help` lists the options.

  Pixels count from the top left; `right` and `bottom` are the last ones inside. An odd last
  column of a picture is dropped. For wrong options or input the exit status is 1, with one line.

  Examples:

      mix blobs photo.jpg --colours sweets.txt --picture found.png
      mix blobs tour.avi --colours landmark.txt --distance YellowLandmark=0.0651 --every 5
      mix blobs /dev/video0 --colours landmark.txt --json - --frames 100
  """
  use Mix.Task
  alias Vision.Blobs.{Options, Report}
  alias Vision.{Blobs, Colours, Picture}

  @impl Mix.Task
  def run(words) do
    Hal.Cli.Command.run("blobs", words, {@moduledoc, Options.table()}, fn given, sources ->
      with {:ok, options} <- Options.check(given, sources),
           :halted <- find(options),
           do: exit({:shutdown, 1})
    end)
  end

  defp find(options) do
    looking_for = options |> Map.take([:distance, :min_area, :backend]) |> Map.to_list()

    with {:ok, colours} <- Colours.read(options.colours, looking_for),
         {:ok, output} <- open(options.json),
         {:ok, summary} <- output |> looked(options, colours) |> close(output, options.json),
         :ok <- draw(options.picture, summary.last, colours) do
      for line <- summary.odd, do: Mix.shell().error("blobs: #{options.source}: #{line}")
      conclude(options, summary)
    end
  end

  defp looked(output, options, colours) do
    terminal? = output != :table and match?({:ok, _columns}, :io.columns(:standard_error))

    report = fn seen ->
      if terminal? and options.json != "-", do: progress(seen)
      write(output, seen)
    end

    result =
      Blobs.run(
        options.source,
        colours,
        report,
        Map.to_list(Map.take(options, [:every, :frames, :unsafe]))
      )

    if terminal?, do: IO.write(:stderr, "\r\e[K")
    result
  end

  defp open(nil), do: {:ok, :table}
  defp open("-"), do: {:ok, :stdio}

  defp open(path) do
    case File.open(path, [:write, :delayed_write]) do
      {:ok, file} ->
        {:ok, {:file, file}}

      {:error, reason} ->
        {:error, "--json #{path} cannot be written: #{:file.format_error(reason)}"}
    end
  end

  defp write(:table, seen), do: print(Report.table(seen))
  defp write(:stdio, seen), do: print([Report.json(seen), ?\n])

  defp write({:file, file}, seen) do
    with {:error, reason} <- :file.write(file, [Report.json(seen), ?\n]) do
      Mix.shell().error("--json: the report cannot be written: #{:file.format_error(reason)}")
      :halt
    end
  end

  # The reader of our output may have seen enough, as `head` has; then the task ends without a
  # message.
  defp print(text) do
    IO.write(text)
  rescue
    error in ErlangError ->
      if error.original == :terminated, do: :halt, else: reraise(error, __STACKTRACE__)
  end

  # Delayed data is written here at the latest, so a full disk shows here. An empty report on a
  # source that cannot be read is removed.
  defp close(result, {:file, file}, path) do
    case {result, File.close(file)} do
      {{:ok, _summary}, {:error, reason}} ->
        {:error, "--json #{path} cannot be written: #{:file.format_error(reason)}"}

      {{:error, _line}, _closed} ->
        if match?({:ok, %File.Stat{size: 0, type: :regular}}, File.stat(path)), do: File.rm(path)
        result

      _both_well ->
        result
    end
  end

  defp close(result, _output, _path), do: result

  defp progress(seen) do
    if rem(seen.number, 10) == 0,
      do:
        IO.write(
          :stderr,
          "\rframe #{seen.number}, #{Report.count(length(seen.blobs), "blob")}\e[K"
        )
  end

  defp draw(nil, _last, _colours), do: :ok
  defp draw(_path, nil, _colours), do: {:error, "no frame to draw into"}
  defp draw(path, last, colours), do: Picture.write(path, last.frame, last.blobs, colours)

  defp conclude(%{json: "-"}, _summary), do: :ok

  defp conclude(options, summary) do
    written = for path <- [options.json, options.picture], path != nil, do: ", #{path} written"
    frames = Report.count(summary.frames, "frame")
    Mix.shell().info("#{frames}, #{Report.count(summary.blobs, "blob")}#{written}")
  end
end
