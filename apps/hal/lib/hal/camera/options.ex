defmodule Hal.Camera.Options do
  @moduledoc """
  The options of `Hal.Camera.FFmpeg`, which lists them. Pure.
  """
  alias Hal.Camera.Source
  alias Hal.Suggest

  @defaults [
    source: nil,
    size: nil,
    rate: nil,
    norm: nil,
    input: nil,
    pixel_format: nil,
    ffmpeg: nil,
    format: :yuyv,
    every: false,
    loop: false
  ]
  # Those that only a V4L2 device understands. Elsewhere they would be silently without effect.
  @of_devices [:rate, :norm, :input, :pixel_format]
  @widest 32_768
  @inputs 0..31

  @doc """
  The options with their defaults, or all that is wrong with them, a line each.

      iex> Hal.Camera.Options.check(source: "/dev/video0", norm: :palm)
      {:error, ["camera option :norm cannot be :palm: :pal, :ntsc or :secam"]}
      iex> Hal.Camera.Options.check(source: "a.mp4", norm: :pal)
      {:error, [~s(camera option :norm is for a V4L2 device such as /dev/video0, not for "a.mp4")]}
  """
  @spec check(keyword()) :: {:ok, keyword()} | {:error, [line :: String.t(), ...]}
  def check(options) do
    {known, unknown} = Keyword.split(options, Keyword.keys(@defaults))
    missing = if options[:source] == nil, do: ["camera option :source is missing"], else: []
    wrong = for option <- known, option != {:source, nil}, not valid?(option), do: refused(option)

    case Enum.map(unknown, &strange/1) ++ missing ++ wrong ++ misplaced(known) do
      [] -> {:ok, Keyword.merge(@defaults, known)}
      lines -> {:error, lines}
    end
  end

  defp strange({name, _value}) do
    names = Enum.map(Keyword.keys(@defaults), &inspect/1)

    case Suggest.nearest(inspect(name), names) do
      nil -> "camera has no option #{inspect(name)}; it has #{Enum.join(names, ", ")}"
      hint -> "camera has no option #{inspect(name)}; did you mean #{hint}?"
    end
  end

  defp misplaced(options) do
    source = options[:source]

    if is_binary(source) and source != "" and Source.kind(source) != :device do
      for {option, value} <- options,
          option in @of_devices and value != nil,
          do:
            "camera option #{inspect(option)} is for a V4L2 device such as /dev/video0, " <>
              "not for #{shown(source)}"
    else
      []
    end
  end

  defp refused({option, value}),
    do: "camera option #{inspect(option)} cannot be #{shown(value)}: #{allowed(option)}"

  defp shown(value), do: inspect(value, limit: 10, printable_limit: 80)

  defp valid?({:source, source}), do: is_binary(source) and source != ""
  defp valid?({:format, format}), do: format in [:yuyv, :i420]
  defp valid?({option, value}) when option in [:every, :loop], do: is_boolean(value)
  defp valid?({_what_has_none_by_default, nil}), do: true
  defp valid?({:rate, rate}), do: is_number(rate) and rate >= 0.1 and rate <= 1_000
  defp valid?({:norm, norm}), do: norm in Source.norms()
  defp valid?({:input, input}), do: input in @inputs
  defp valid?({:pixel_format, format}), do: format in Source.pixel_formats()
  defp valid?({:ffmpeg, path}), do: is_binary(path)

  defp valid?({:size, {width, height}}),
    do: width in 2..@widest//2 and height in 2..@widest//2

  defp valid?({:size, _other}), do: false

  defp allowed(:source), do: "a file, stream or device"
  defp allowed(:format), do: ":yuyv or :i420"
  defp allowed(option) when option in [:every, :loop], do: "true or false"
  defp allowed(:rate), do: "frames a second, 0.1 to 1000"
  defp allowed(:norm), do: one_of(Source.norms())
  defp allowed(:input), do: "the number of a socket, #{@inputs.first} to #{@inputs.last}"
  defp allowed(:pixel_format), do: one_of(Source.pixel_formats())
  defp allowed(:size), do: "{width, height}, even numbers up to #{@widest}"
  defp allowed(:ffmpeg), do: "the path of ffmpeg"

  defp one_of(names) do
    {last, names} = List.pop_at(names, -1)
    Enum.map_join(names, ", ", &inspect/1) <> " or " <> inspect(last)
  end
end
