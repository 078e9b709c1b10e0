defmodule Tools.Calibrate.Colour do
  @moduledoc false
  # Runs `mix calibrate colour`: derives the limits of a colour from places in a picture, shows their effect in that
  # picture, and writes the colour file.
  alias Tools.Calibrate.{ColourOptions, Frames, StdinPrompt}
  alias Console.Cli.{Diff, Format, OutFile}
  alias Vision.Calibration
  alias Vision.Calibration.Sample
  alias Vision.{Colours, Picture}

  # If more than this share of the given places does not count as the colour, the person should
  # know.
  @few 0.7
  @alike 0.6

  @doc "Runs the command. An error is one line."
  @spec run(ColourOptions.t()) :: :ok | {:error, String.t()}
  def run(options) do
    with {:ok, frames} <- Frames.take(options.source, options.frames),
         {:ok, found} <-
           Calibration.find(frames, options.places, options.name,
             tolerance: options.tolerance,
             min_area: options.min_area
           ),
         frame = List.last(frames),
         :ok <- draw(options, frame, found),
         IO.puts(
           "#{options.source}: #{frame.width} by #{frame.height} pixels, #{Format.count(length(frames), "frame")}"
         ),
         Enum.each(lines(found, options) ++ warnings(found, options), &IO.puts/1) do
      put(options, found.class)
    end
  end

  # The result, as lines of text.
  defp lines(%{class: class, match: match} = found, options) do
    {y, u, v} = found.middle

    [
      "sample   #{found.pixels} pixels, #{percent(found.share)} of them alike: about Y #{y} U #{u} V #{v}",
      "limits   Y #{range(class.y)}  U #{range(class.u)}  V #{range(class.v)}  #{Colours.Edit.limits(class)}",
      "light    #{percent(found.tolerance)} more or less is tolerated",
      "inside   #{match.hit} of #{match.inside} pixels count as #{class.name} (#{share(match.hit, match.inside)})",
      "outside  #{match.outside} pixels#{elsewhere(match)}"
    ] ++ distance(options.metres, match.blobs, class.name)
  end

  defp elsewhere(%{others: []}), do: ", all of them next to your places or too small for a blob"

  defp elsewhere(match),
    do: ", #{match.background} of them in #{Format.count(length(match.others), "blob")} elsewhere"

  defp distance(nil, _blobs, _name), do: []
  defp distance(_metres, [], _name), do: []

  defp distance(metres, blobs, name) do
    largest = Enum.max_by(blobs, & &1.area)

    if largest.share > 0.5 do
      ["distance it fills more than half of the picture: too near to find a constant"]
    else
      constant = Format.decimals(largest.share * metres * metres, 4)

      [
        "distance it fills #{percent(largest.share)}: in the robot file, distance: %{#{inspect(name)} => #{constant}}"
      ]
    end
  end

  # The warnings about what a person should check, as lines of text.
  defp warnings(%{match: match} = found, options) do
    [
      found.share < @alike &&
        "WARNING: #{percent(1 - found.share)} of the sample have another colour and were left out: " <>
          "give a smaller box, or points",
      match.hit < @few * match.inside && found.share >= @alike &&
        "WARNING: only #{share(match.hit, match.inside)} of your places count as #{options.name}",
      match.blobs == [] &&
        "WARNING: no blob of at least #{options.min_area} pixels is left where you pointed",
      background(match, options)
    ]
    |> Enum.filter(& &1)
  end

  defp background(%{others: []}, _options), do: nil

  defp background(%{others: [largest | _]} = match, options) do
    less =
      if options.tolerance == :auto,
        do: "a smaller box, points on the colour alone, or another colour may help",
        else: "less --light may help"

    "WARNING: background counts as #{options.name}: #{match.background} pixels, the largest blob (#{largest.area}) at " <>
      "#{round(largest.x)},#{round(largest.y)}; if that is a different thing, #{less}"
  end

  defp draw(%{picture: nil}, _frame, _found), do: :ok

  defp draw(%{picture: path} = options, frame, found) do
    {:ok, colours} = Colours.new([found.class], min_area: options.min_area)
    boxes = for place <- options.places, do: Sample.bounds(place, frame.width, frame.height)
    blobs = found.match.blobs ++ found.match.others

    with :ok <- Picture.write(path, frame, blobs, colours, classified: true, boxes: boxes),
         do: IO.puts("#{path} written: please check it")
  end

  defp put(%{colours: nil}, class) do
    {:ok, text} = Colours.Edit.put("", class)
    IO.puts("")
    IO.write(text)
  end

  defp put(%{colours: path} = options, class) do
    with {:ok, old} <- read(path),
         {:ok, new} <- Colours.Edit.put(old, class) do
      IO.puts("#{path}:")
      if old == "", do: IO.write(new), else: Enum.each(Diff.lines(old, new), &IO.puts("  " <> &1))
      decide(path, new, old == new, options.write)
    else
      {:error, line} ->
        {:error, "#{path}:" <> String.replace_prefix(" " <> line, " colour file:", "")}
    end
  end

  defp read(path) do
    case {File.stat(path), File.read(path)} do
      {{:error, :enoent}, _} ->
        {:ok, ""}

      {{:ok, %File.Stat{type: :regular, size: size}}, {:ok, text}} when size <= 1_048_576 ->
        {:ok, text}

      {_stat, {:error, reason}} ->
        {:error, "#{:file.format_error(reason)}"}

      _large_or_strange ->
        {:error, "is not a colour file"}
    end
  end

  defp decide(path, _new, true, _write?), do: IO.puts("#{path} is already up to date")
  defp decide(path, new, _same?, true), do: replace(path, new)

  defp decide(path, new, _same?, false) do
    talk = StdinPrompt.start()
    answer = StdinPrompt.choose(talk, "write it? (yes, no) ", ["yes", "no"])
    StdinPrompt.stop(talk)

    case answer do
      {:ok, "yes"} -> replace(path, new)
      _no_or_nobody -> IO.puts("#{path} not written; --write writes it")
    end
  end

  defp replace(path, new) do
    with :ok <- OutFile.write(path, new), do: IO.puts("#{path} written")
  end

  defp range({low, high}), do: "#{low} to #{high}"
  defp share(_part, 0), do: "none"
  defp share(part, all), do: percent(part / all)
  defp percent(share), do: "#{Format.decimals(100 * share, 1)} %"
end
