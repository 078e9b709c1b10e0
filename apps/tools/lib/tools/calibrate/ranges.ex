defmodule Tools.Calibrate.Ranges do
  @moduledoc false
  # Runs `mix calibrate ranges`: a robot that stands before a wall at known distances tells what one of its sonars or infrareds hears,
  # and the conversions are found by that. Its wheels stay disarmed.
  alias Console.Cli.Format
  alias Hal.Cli.{Arguments, Parse}
  alias Hal.RFlex.Conversions
  alias Robot.Calibration.Ranges
  alias Tools.Calibrate.{Live, RobotFile, StdinPrompt}

  @looks 15
  @most 20

  @type t :: %{
          file: Path.t(),
          kind: :sonar | :infrared,
          number: non_neg_integer() | nil,
          at: [float(), ...] | nil,
          told: [float()] | nil,
          write: boolean()
        }

  @doc "The table of the options, as `Hal.Cli.Arguments` takes it."
  @spec table() :: [Arguments.option()]
  def table do
    [
      {"sensor", "KIND", &Parse.choice(&1, sonar: :sonar, infrared: :infrared),
       "sonar or infrared (sonar)"},
      {"number", "N", &Parse.whole(&1, 0..63),
       "which one, from 0, in the order of the body (the one that looks most nearly ahead)"},
      {"at", "METRES,…", &metres/1,
       "how far the wall is from it, once for each stand (0.5,1,2; infrared 0.2,0.4,0.6)"},
      {"told", "METRES,…", &metres/1,
       "typed in: what it told at these distances; then no robot is asked"},
      {"write", nil, nil, "writes the robot file without asking; prints the changes"}
    ]
  end

  @doc """
  Reads the arguments after `ranges`.

      iex> {:ok, options} = Tools.Calibrate.Ranges.parse(~w(config/robots/mag1.exs --at 0.5,1.5))
      iex> {options.kind, options.at, options.number}
      {:sonar, [0.5, 1.5], nil}
      iex> Tools.Calibrate.Ranges.parse(~w(mag1.exs --at 0.5,1.5 --told 0.5))
      {:error, ["--told has 1 distances, and --at 2"]}
      iex> Tools.Calibrate.Ranges.parse(~w(--at 0.5))
      {:error, ["the robot file is missing: mix calibrate ranges config/robots/NAME.exs"]}
  """
  @spec parse([String.t()]) :: {:ok, t()} | :help | {:error, [String.t()]}
  def parse(["--" <> _ | _] = words), do: parse(nil, words)
  def parse([file | words]), do: parse(file, words)
  def parse([]), do: parse(nil, [])

  defp parse(file, words) do
    with {:ok, given} <- Arguments.parse(words, table()) do
      map = Map.new(given)
      if map["help"], do: :help, else: check(file, map)
    end
  end

  defp check(file, map) do
    {at, told} = {map["at"], map["told"]}

    cond do
      file == nil ->
        {:error, ["the robot file is missing: mix calibrate ranges config/robots/NAME.exs"]}

      told != nil and at == nil ->
        {:error, ["--told needs the distances at which it was told: --at"]}

      told != nil and length(told) != length(at) ->
        {:error, ["--told has #{length(told)} distances, and --at #{length(at)}"]}

      true ->
        {:ok,
         %{
           file: file,
           kind: map["sensor"] || :sonar,
           number: map["number"],
           at: at,
           told: told,
           write: map["write"] || false
         }}
    end
  end

  defp metres(text) do
    all = for word <- String.split(text, ","), do: Parse.number(String.trim(word), 0.05, 10)
    wrong = Enum.find(all, &match?({:error, _allowed}, &1))

    if wrong == nil and length(all) <= @most,
      do: {:ok, for({:ok, metres} <- all, do: metres)},
      else: {:error, "up to #{@most} distances from 0.05 to 10 m, such as 0.5,1,2"}
  end

  @doc "Runs the command. An error is one line, or several."
  @spec run(t()) :: :ok | {:error, String.t() | [String.t()]}
  def run(%{file: path} = options) do
    with {:ok, file, conversions} <- RobotFile.load(path),
         :ok <- convertible(path, conversions),
         {:ok, number} <- number(options, file.profile) do
      {file, conversions} = RobotFile.published(file, conversions)
      {file, conversions} = ranged(options.kind, file, conversions)
      s = Map.merge(options, %{id: file.id, number: number, conversions: conversions})

      if options.told,
        do: tell(Enum.zip(options.at, options.told), s, file, nil),
        else: Live.with_robot(file, &stands(s, file, &1))
    end
  end

  defp convertible(path, nil), do: {:error, "#{path}: its drive has no conversions to correct"}
  defp convertible(_path, _conversions), do: :ok

  # A sonar without its conversion tells nothing.
  defp ranged(:infrared, file, conversions), do: {file, conversions}

  defp ranged(:sonar, %{drive: {driver, drive}} = file, conversions) do
    conversions = Keyword.put_new(conversions, :range, Conversions.range())
    {%{file | drive: {driver, Keyword.put(drive, :conversions, conversions)}}, conversions}
  end

  defp number(%{kind: kind, number: number}, profile) do
    case {poses(kind, profile), number} do
      {[], _number} ->
        {:error, "this body has no #{kind}"}

      {poses, nil} ->
        ahead = Enum.min_by(poses, &abs(&1.heading))
        {:ok, Enum.find_index(poses, &(&1 == ahead))}

      {poses, number} when number < length(poses) ->
        {:ok, number}

      {poses, number} ->
        {:error, "--number: expected 0 to #{length(poses) - 1}, got #{number}"}
    end
  end

  defp poses(:sonar, profile), do: profile.sonars
  defp poses(:infrared, profile), do: profile.irs

  defp stands(s, file, talk) do
    distances = s.at || if s.kind == :sonar, do: [0.5, 1.0, 2.0], else: [0.2, 0.4, 0.6]
    pairs = Enum.flat_map(distances, &stand(&1, s, talk))
    if pairs == [], do: {:error, "nothing was measured"}, else: tell(pairs, s, file, talk)
  end

  defp stand(metres, s, talk) do
    IO.puts(
      "\nPut #{s.id} so that #{s.kind} #{s.number} is #{Format.decimals(metres, 2)} m from a flat wall, and looks at it squarely."
    )

    case StdinPrompt.choose(talk, "go, skip or quit? ", ["go", "skip", "quit"]) do
      {:ok, "go"} -> heard(metres, s, talk)
      {:ok, "skip"} -> []
      _quit_or_end -> throw({:quit, "ended by the user; nothing is written"})
    end
  end

  defp heard(metres, s, talk) do
    key = if s.kind == :sonar, do: :sonar, else: :ir

    case Live.ranges(s.id, key, @looks) do
      looks when length(looks) >= div(@looks, 2) ->
        told = looks |> Enum.map(&Enum.at(&1, s.number)) |> Enum.sort()
        median = Enum.at(told, div(length(told), 2))
        spread = List.last(told) - hd(told)

        IO.puts(
          "  it tells #{Format.decimals(median, 3)} m (#{length(told)} times, within #{Format.decimals(spread, 3)} m)"
        )

        [{metres, median}]

      looks ->
        IO.puts("  #{s.id} told its ranges in #{length(looks)} of #{@looks} looks: too few")
        stand(metres, s, talk)
    end
  end

  defp tell(pairs, s, file, talk) do
    with {:ok, keys, worst} <- found(pairs, s, file) do
      IO.puts(
        "#{RobotFile.text(keys)}: the distances would be told within #{Format.decimals(worst, 3)} m"
      )

      wanted = if s.write, do: :always, else: talk || :never
      RobotFile.write(s.file, keys, wanted)
    end
  end

  defp found(pairs, %{kind: :sonar, conversions: conversions}, _file) do
    with {:ok, units, worst} <- Ranges.sonar(pairs, conversions[:range]),
         do: {:ok, [range: units], worst}
  end

  # One law for all of them; where each has its own, only a person can say what belongs together.
  defp found(pairs, %{conversions: conversions}, %{drive: {_driver, options}}) do
    case {conversions[:ir_a], conversions[:ir_b]} do
      {a, b} when is_number(a) and is_number(b) ->
        law = options[:ir_law] || :metres

        with {:ok, {a, b}, worst} <- Ranges.infrared(pairs, {a * 1.0, b * 1.0}, law),
             do: {:ok, [ir_a: a, ir_b: b], worst}

      {nil, _b} ->
        {:error, "conversions ir_a and ir_b must be there, to begin with 4000.0 and -2.0"}

      _lists ->
        {:error,
         "each infrared has a law of its own in this file; give all the same to measure one"}
    end
  end
end
