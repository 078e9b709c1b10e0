defmodule Tools.Replay.Recording do
  @moduledoc false
  # Opens the recording that `mix replay` is about: of a run in lockstep, or of robots of processes.
  alias Console.Cli.Format
  alias Tools.Replay.Guard
  alias Record.Recording, as: Robots
  alias Lab.Replay.Kind

  @enforce_keys [:file, :about, :from, :options, :begin]
  defstruct @enforce_keys

  @typedoc """
  `about` and `from` are words of its heading; `options` are those of its start by which people tell two recordings apart,
  `begin` all of the start that must be the same in both.
  """
  @type t :: %__MODULE__{
          file: Lab.Recording.File.t() | Robots.File.t(),
          about: String.t(),
          from: String.t(),
          options: map(),
          begin: term()
        }

  @doc "Opens a file; the error is one line that names it."
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(path) do
    Lab.Recording.File.know()

    with :other <- Robots.File.open(path),
         {:ok, file} <- Lab.Recording.File.open(path) do
      {:ok, lockstep(file)}
    else
      {:ok, %Robots.File{} = file} -> {:ok, robots(file)}
      {:error, line} -> {:error, line}
    end
  end

  defp lockstep(%{setup: %{options: options} = setup} = file) do
    about =
      "#{Format.count(length(setup.robots), "robot")} in #{options.map}, seed #{options.seed}"

    %__MODULE__{file: file, about: about, from: "", options: options, begin: setup}
  end

  defp robots(file) do
    ids = Robots.File.ids(file)
    {:ok, began} = DateTime.from_unix(div(file.start_ms, 1000))
    profiles = for {id, %{profile: profile}} <- file.robots, into: %{}, do: {id, profile}

    %__MODULE__{
      file: file,
      about: "#{Format.count(length(ids), "live robot")} (#{Enum.join(ids, ", ")})",
      from: ", from #{DateTime.to_string(began)}",
      options: %{robots: ids},
      begin: profiles
    }
  end

  @doc "The first line: what the file has."
  @spec heading(t()) :: String.t()
  def heading(%__MODULE__{file: file} = recording) do
    "#{file.path}: #{recording.about}, #{Format.seconds(last_ms(recording))}#{recording.from}" <>
      if(file.whole?, do: "", else: " (not ended in order: read as far as it is whole)")
  end

  @doc "The names of the recorded robots."
  @spec names(t()) :: [String.t()]
  def names(%__MODULE__{file: %Robots.File{} = file}),
    do: Enum.map(Robots.File.ids(file), &"#{&1}")

  def names(%__MODULE__{file: file}), do: for(robot <- file.setup.robots, do: "#{robot.id}")

  @doc "The end of the last tick, in ms from the start."
  @spec last_ms(t()) :: non_neg_integer()
  def last_ms(%__MODULE__{file: %module{} = file}), do: module.last_ms(file)

  @doc "The ticks from the one that ends then or later, lazily; taken in a guard (`Tools.Replay.Guard`)."
  @spec ticks(t(), from_ms :: non_neg_integer()) :: Enumerable.t()
  def ticks(%__MODULE__{file: %module{} = file}, from_ms \\ 0),
    do: Guard.watched(module.ticks(file, from_ms: from_ms))

  @doc "The ticks as they are compared with those of another recording of this kind."
  @spec comparable(t()) :: Enumerable.t()
  def comparable(%__MODULE__{file: %Robots.File{} = file}),
    do: Guard.watched(Robots.File.comparable(file))

  def comparable(recording), do: ticks(recording)

  @doc "The start of a replay; of robots of processes that of one alone, if it is named."
  @spec replay(t(), only :: String.t() | nil) :: Kind.t()
  def replay(%__MODULE__{file: %Robots.File{} = file}, only),
    do: Lab.Replay.Robots.new(file, only)

  def replay(%__MODULE__{file: file}, _only), do: Lab.Replay.new(file.setup)

  @doc "Whether two are of one kind; the error is one line."
  @spec alike(t(), t()) :: :ok | {:error, line :: String.t()}
  def alike(%{file: %kind{}}, %{file: %kind{}}), do: :ok

  def alike(one, other) do
    {:error,
     "--against needs two recordings of one kind: #{one.file.path} is #{kind(one)}, " <>
       "#{other.file.path} is #{kind(other)}"}
  end

  defp kind(%{file: %Robots.File{}}), do: "of live robots"
  defp kind(_lockstep), do: "of a run in lockstep"
end
