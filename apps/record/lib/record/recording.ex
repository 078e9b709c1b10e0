defmodule Record.Recording do
  @moduledoc """
  Describes what Convoy's own part of a recording of robots of processes holds, and how it is written. Pure.

  A recording is an MCAP file (`Mcap`). Beside the topics that other programs draw
  (`Record.Recording.Topics`) it has these of ours, in Erlang's external term format:

  | topic | message |
  |---|---|
  | `/convoy/robot` | the version, all names (`Record.Recording.Names`), the profile of each robot, and the offset of its clock; at the beginning of a file, and when one of them changes |
  | `/convoy/trace` | each second: what went into and out of the robots' processes, in order (`Robot.Trace`) |

  References and processes are written as text (`Record.Recording.Terms`), and the profile of its
  robot, which is in each percept, as a mark.
  """
  alias Hal.Profile
  alias Record.Recording.{Names, Terms}
  alias Record.Replay
  alias Record.Replay.Roles

  @version 8
  @robots "/convoy/robot"
  @trace "/convoy/trace"
  @encoding "erlang-term"
  # A second of a hundred robots takes some 30 MB, and in memory some four times as much; a tick of a run some 0.3 MB, its start
  # the map and the world.
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

  @doc "The content of a message about the robots, with all names that the file has up to then."
  @spec robots(robots(), Names.t()) :: binary()
  def robots(robots, names) do
    names = Names.add(names, robots)
    write({:convoy_robots, @version, Names.texts(names), write(robots)})
  end

  @doc """
  The content of a message with entries, in their order, and the names with those of the entries.

      iex> entry = {:mag1, {:gate, :input, :step, 50}}
      iex> {bytes, _names} = Record.Recording.trace([entry], %{}, MapSet.new())
      iex> Record.Recording.read_trace(bytes, %{})
      {:ok, [entry]}
  """
  @spec trace([Replay.entry()], robots(), Names.t()) :: {binary(), Names.t()}
  def trace(entries, robots, names) do
    portable = for {id, entry} <- entries, do: {id, Terms.portable(entry, profile(robots, id))}
    {write(portable), Names.add(names, portable)}
  end

  @doc """
  The robots from a message about them, whose names become known to this program. At most `left` may be new; returns how many may be
  after that.
  """
  @spec read_robots(binary(), left :: non_neg_integer()) ::
          {:ok, robots(), left :: non_neg_integer()} | {:error, line :: String.t()}
  def read_robots(bytes, left \\ Names.most()) do
    case read(bytes) do
      {:ok, {:convoy_robots, @version, names, robots}} when is_binary(robots) ->
        with {:ok, left} <- know(names, left),
             {:ok, %{} = robots} <- read(robots),
             true <- Enum.all?(robots, &robot?/1) do
          {:ok, robots, left}
        else
          {:error, line} -> {:error, line}
          _other -> refuse(:error, :convoy_robots, @version)
        end

      other ->
        refuse(other, :convoy_robots, @version)
    end
  end

  @doc """
  Makes the names of a recording, which it has as text, known to this program; at most `left` may be new. Returns how many may be
  after that; the error is one line.

      iex> Record.Recording.know(["ok", "nil"])
      {:ok, 1_000}
  """
  @spec know(names :: term(), left :: non_neg_integer()) ::
          {:ok, left :: non_neg_integer()} | {:error, line :: String.t()}
  def know(names, left \\ Names.most()), do: Names.know(names, left)

  @doc """
  What is wrong with the first message of a recording (`read/1`), which is no tuple of this name and this version.

      iex> Record.Recording.refuse({:ok, {:convoy, 1, nil}}, :convoy, 5)
      {:error, "is a recording of version 1; this program reads version 5"}
      iex> Record.Recording.refuse(:error, :convoy, 5)
      {:error, "begins with something that this program did not record"}
  """
  @spec refuse({:ok, term()} | :error, name :: atom(), version :: pos_integer()) ::
          {:error, line :: String.t()}
  def refuse({:ok, first}, name, version)
      when elem(first, 0) == name and is_integer(elem(first, 1)) and elem(first, 1) != version,
      do:
        {:error,
         "is a recording of version #{elem(first, 1)}; this program reads version #{version}"}

  def refuse(_other, _name, _version),
    do: {:error, "begins with something that this program did not record"}

  defp robot?({id, %{offset_ms: offset_ms, profile: profile}}) when is_atom(id),
    do:
      (offset_ms == nil or is_integer(offset_ms)) and
        (profile == nil or is_struct(profile, Profile))

  defp robot?(_other), do: false

  @doc "The entries from a message with some."
  @spec read_trace(binary(), robots()) :: {:ok, [Replay.entry()]} | {:error, line :: String.t()}
  def read_trace(bytes, robots) do
    with {:ok, entries} when is_list(entries) <- read(bytes),
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

  @doc "A recorded term, of a message of either kind of recording, of at most 256 MB in memory. Creates no atoms."
  @spec read(binary()) :: {:ok, term()} | :error
  def read(bytes), do: Hal.ExternalTerm.decode(bytes, @most_bytes)
end
