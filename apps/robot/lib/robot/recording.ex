defmodule Robot.Recording do
  @moduledoc """
  Describes what Convoy's own part of a recording of robots of processes holds, and how it is written. Pure.

  A recording is an MCAP file (`Mcap`). Beside the topics that other programs draw
  (`Robot.Recording.Topics`) it has these of ours, in Erlang's external term format:

  | topic | message |
  |---|---|
  | `/convoy/robot` | the version, the profile of each robot, and the offset of its clock; at the beginning of a file, and when one of them changes |
  | `/convoy/trace` | each second: what went into and out of the robots' processes, in order (`Robot.Trace`) |

  References and processes are written as text (`Robot.Recording.Terms`), and the profile of its
  robot, which is in each percept, as a mark.
  """
  alias Hal.Profile
  alias Robot.Recording.Terms
  alias Robot.Replay
  alias Robot.Replay.Roles

  @version 2
  @robots "/convoy/robot"
  @trace "/convoy/trace"
  @encoding "erlang-term"
  # A second of a hundred robots takes some 30 MB, and in memory some four times as much.
  @most_bytes 256_000_000

  @typedoc "What is added to a robot's time (ms) for that of Unix, and its body."
  @type robot :: %{offset_ms: integer() | nil, profile: Profile.t() | nil}
  @type robots :: %{(id :: atom()) => robot()}

  @doc "The topics of ours: the robots, the trace; and their encoding."
  @spec topics() :: {robots :: String.t(), trace :: String.t(), encoding :: String.t()}
  def topics, do: {@robots, @trace, @encoding}

  @doc "What tools that know nothing of Convoy show of a recording."
  @spec metadata([atom()]) :: %{String.t() => String.t()}
  def metadata(robots),
    do: %{"version" => "#{@version}", "live" => Enum.map_join(robots, ",", &Atom.to_string/1)}

  @doc "The content of a message about the robots."
  @spec robots(robots()) :: binary()
  def robots(robots), do: write({:convoy_robots, @version, robots})

  @doc """
  The content of a message with entries, in their order.

      iex> entry = {:mag1, {:gate, :input, :step, 50}}
      iex> bytes = Robot.Recording.trace([entry], %{})
      iex> Robot.Recording.read_trace(bytes, %{})
      {:ok, [entry]}
  """
  @spec trace([Replay.entry()], robots()) :: binary()
  def trace(entries, robots) do
    write(for {id, entry} <- entries, do: {id, Terms.portable(entry, profile(robots, id))})
  end

  @doc "The robots from a message about them."
  @spec read_robots(binary()) :: {:ok, robots()} | {:error, line :: String.t()}
  def read_robots(bytes) do
    case read(bytes, @most_bytes) do
      {:ok, {:convoy_robots, @version, %{} = robots}} ->
        if Enum.all?(robots, &robot?/1), do: {:ok, robots}, else: strange()

      {:ok, {:convoy_robots, version, _robots}} when is_integer(version) ->
        {:error, "is a recording of version #{version}; this program reads version #{@version}"}

      _other ->
        strange()
    end
  end

  defp strange, do: {:error, "begins with something that this program did not record"}

  defp robot?({id, %{offset_ms: offset_ms, profile: profile}}) when is_atom(id),
    do:
      (offset_ms == nil or is_integer(offset_ms)) and
        (profile == nil or is_struct(profile, Profile))

  defp robot?(_other), do: false

  @doc "The entries from a message with some."
  @spec read_trace(binary(), robots()) :: {:ok, [Replay.entry()]} | {:error, line :: String.t()}
  def read_trace(bytes, robots) do
    with {:ok, entries} when is_list(entries) <- read(bytes, @most_bytes),
         {:ok, entries} <- entries(entries, robots, []) do
      {:ok, entries}
    else
      _other -> {:error, "has entries that this version of the program did not record"}
    end
  end

  defp entries([{id, {_role, _kind, _what, at_ms} = entry} | rest], robots, read)
       when is_atom(id) and is_integer(at_ms) do
    with {:ok, {role, kind, what, _at_ms} = entry} <- Terms.local(entry, profile(robots, id)),
         true <- Roles.entry?(role, kind, what),
         do: entries(rest, robots, [{id, entry} | read])
  end

  defp entries([], _robots, read), do: {:ok, Enum.reverse(read)}
  defp entries(_other, _robots, _read), do: :error

  defp profile(robots, id), do: get_in(robots, [id, :profile])

  defp write(term), do: :erlang.term_to_binary(term, [:deterministic, compressed: 6])

  @doc "A recorded term that takes so many bytes of memory at most. Creates no atoms."
  @spec read(binary(), most_bytes :: pos_integer()) :: {:ok, term()} | :error
  def read(bytes, most_bytes), do: Hal.ExternalTerm.decode(bytes, most_bytes)
end
