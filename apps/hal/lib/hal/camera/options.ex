defmodule Hal.Camera.Options do
  @moduledoc false
  # Checks the options of `Hal.Camera.FFmpeg`, where they are listed. Pure.
  alias Hal.Camera.Source
  alias Hal.Options

  @widest 32_768
  @table [
    source: [{:path, "a file, stream or device"}, required: true],
    size: [
      {:check, &__MODULE__.size?/1, "{width, height}, even numbers up to #{@widest},"},
      default: nil
    ],
    rate: [{:number, 0.1, 1_000, "frames a second"}, default: nil],
    norm: [{:one_of, Source.norms()}, default: nil],
    input: [{:integer, 0, 31}, default: nil],
    pixel_format: [{:one_of, Source.pixel_formats()}, default: nil],
    ffmpeg: [:path, default: nil],
    format: [{:one_of, [:yuyv, :i420]}, default: :yuyv],
    every: [:boolean, default: false],
    loop: [:boolean, default: false],
    unsafe: [:boolean, default: false]
  ]
  # Options that only a V4L2 device understands; any other source would silently ignore them.
  @of_devices [:rate, :norm, :input, :pixel_format]

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc """
  Checks the options and adds the defaults; the error is one line that says what is wrong.

      iex> Hal.Camera.Options.check(source: "/dev/video0", norm: :palm)
      {:error, "camera option norm: expected :pal, :ntsc or :secam, got :palm; did you mean :pal?"}
      iex> Hal.Camera.Options.check(source: "a.mp4", norm: :pal)
      {:error, ~s(camera option norm is for a V4L2 device such as /dev/video0, not for "a.mp4")}
      iex> Hal.Camera.Options.check(source: "gopher://camera/1") |> elem(1) |> String.slice(0, 42)
      "camera option source: expected a stream by"
  """
  @spec check(keyword()) :: {:ok, keyword()} | {:error, line :: String.t()}
  def check(options) do
    with {:ok, options} <- Options.check(options, @table, "camera") do
      case misplaced(options) ++ refused(options) do
        [] -> {:ok, options}
        problems -> {:error, Options.line(problems, "camera")}
      end
    end
  end

  defp misplaced(options) do
    if Source.kind(options[:source]) == :device do
      []
    else
      source = Options.Wording.show(options[:source])
      text = "is for a V4L2 device such as /dev/video0, not for #{source}"
      for key <- @of_devices, options[key] != nil, do: {[Atom.to_string(key)], text}
    end
  end

  defp refused(options) do
    why = unless options[:unsafe], do: Source.refused(options[:source])
    source = Options.Wording.show(options[:source])
    if why, do: [{["source"], "#{why}, or unsafe: true, got #{source}"}], else: []
  end

  @doc false
  def size?({width, height}), do: width in 2..@widest//2 and height in 2..@widest//2
  def size?(_other), do: false
end
