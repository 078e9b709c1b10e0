defmodule Tools.Calibrate.RobotFile do
  @moduledoc false
  # Writes the result into a robot file. It shows the change before it writes, and changes nothing
  # but these numbers.
  alias Tools.Calibrate.StdinPrompt
  alias Console.Cli.{Diff, OutFile}
  alias Robot.Calibration.Keys
  alias Swarm.MemberSpec

  @doc "Reads the file, and the conversions of its drive, `nil` for a drive that has none."
  @spec load(Path.t()) :: {:ok, Robot.File.t(), keyword() | nil} | {:error, [String.t()]}
  def load(path) do
    with {:ok, file} <- MemberSpec.load(path) do
      {_driver, options} = file.drive
      conversions = if known?(file.drive), do: options[:conversions] || []
      {:ok, file, conversions}
    end
  end

  defp known?({driver, options}),
    do: driver == Hal.RFlex.Driver or is_list(options[:conversions])

  @doc """
  The robot, disarmed, with the published conversions of the wheels that its file lacks, and those conversions. Without any a base
  neither arms nor reports odometry; with those of another base it is off by some percent.
  """
  @spec published(Robot.File.t(), keyword() | nil) :: {Robot.File.t(), keyword() | nil}
  def published(file, nil), do: {%{file | arm: :manual}, nil}

  def published(%{drive: {driver, drive}} = file, conversions) do
    published = Keys.published(file.profile.rflex)
    missing = for {key, _value} <- published, conversions[key] == nil, do: key

    if missing != [],
      do: IO.puts("#{Enum.join(missing, " and ")} not known yet: using the published ones")

    conversions = Keyword.merge(published, Enum.reject(conversions, fn {_key, v} -> v == nil end))
    drive = Keyword.put(drive, :conversions, conversions)
    {%{file | drive: {driver, drive}, arm: :manual}, conversions}
  end

  @doc """
  Shows the change, and writes it `:always`, `:never`, or if the person who is asked by `talk`
  agrees. The new file replaces the old one atomically.
  """
  @spec write(Path.t(), keyword(float()), :always | :never | StdinPrompt.t()) ::
          :ok | {:error, String.t()}
  def write(path, keys, wanted) do
    with {:ok, old} <- read(path),
         {:ok, new} <- Robot.File.Edit.conversions(old, keys),
         :ok <- same?(path, old, new, keys) do
      IO.puts("#{path}:")
      Enum.each(Diff.lines(old, new), &IO.puts("  " <> &1))
      decide(path, new, old == new, wanted)
    else
      {:error, line} ->
        {:error, "#{path}: #{line}; write it yourself: conversions: [#{text(keys)}]"}
    end
  end

  @doc """
  The keys as they are written in a robot file.

      iex> Tools.Calibrate.RobotFile.text(distance: 31000.5, angle: 4700.25)
      "distance: 31000.5, angle: 4700.25"
  """
  @spec text(keyword(float())) :: String.t()
  def text(keys), do: Enum.map_join(keys, ", ", fn {key, value} -> "#{key}: #{value}" end)

  defp read(path) do
    with {:error, reason} <- File.read(path), do: {:error, "#{:file.format_error(reason)}"}
  end

  # Both files are read as a robot would read them.
  defp same?(path, old, new, keys) do
    with {:ok, before} <- parse(path, old), {:ok, now} <- parse(path, new) do
      {driver, options} = now.drive
      {_driver, was} = before.drive

      expected = Keyword.merge(was[:conversions] || [], keys)

      if Enum.sort(options[:conversions]) == Enum.sort(expected) and
           %{now | drive: {driver, Keyword.delete(options, :conversions)}} ==
             %{before | drive: {driver, Keyword.delete(was, :conversions)}},
         do: :ok,
         else: {:error, "the numbers cannot be written into it"}
    else
      {:error, [line | _]} -> {:error, line}
    end
  end

  defp parse(path, text) do
    folder = Path.dirname(path)
    colours = fn file, options -> Vision.Colours.read(Path.expand(file, folder), options) end
    Robot.File.parse(text, file: path, colours: colours, tables: MemberSpec.tables())
  end

  defp decide(path, _new, true, _wanted), do: IO.puts("#{path} is already up to date")
  defp decide(path, _new, _same?, :never), do: IO.puts("#{path} not written; --write writes it")
  defp decide(path, new, _same?, :always), do: replace(path, new)

  defp decide(path, new, _same?, %StdinPrompt{} = talk) do
    case StdinPrompt.choose(talk, "write it? (yes, no) ", ["yes", "no"]) do
      {:ok, "yes"} -> replace(path, new)
      _no_or_end -> IO.puts("#{path} not written")
    end
  end

  defp replace(path, new) do
    with :ok <- OutFile.write(path, new),
         do: IO.puts("#{path} written; mix robot.check #{path} shows what it says")
  end
end
