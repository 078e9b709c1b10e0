defmodule Lab.Recording do
  @moduledoc """
  Describes what Convoy's own part of a recording holds, and how it is written. Pure.

  A recording is an MCAP file (`Mcap`). Beside the topics that other programs draw
  (`Lab.Recording.Topics`) it has these of ours, in Erlang's external term format:

  | topic | message |
  |---|---|
  | `/convoy/start` | once: the version, the names of robots and of bodies as text, and the start: world, robots with their bodies, mission (`Lab.Trial.Setup`) |
  | `/convoy/ticks` | each 100 ms: all inputs of the robots with their effects, and all interventions |

  A tick is written in a short form (`Record.Recording.Tick`), and without compression: that would cost
  a run more than all the rest of its recording.
  """
  alias Record.Recording, as: Shared
  alias Record.Recording.Tick
  alias Lab.Trial
  alias Lab.Trial.Setup

  @version 7
  @start "/convoy/start"
  @ticks "/convoy/ticks"
  @encoding "erlang-term"

  @typedoc "A tick: its entries in their order, and the time at its end."
  @type tick :: {at_ms :: non_neg_integer(), [Trial.entry()]}

  @doc "The topics of ours: the start, the ticks; and their encoding."
  @spec topics() :: {start :: String.t(), ticks :: String.t(), encoding :: String.t()}
  def topics, do: {@start, @ticks, @encoding}

  @doc "What tools that know nothing of Convoy show of a recording."
  @spec metadata(Setup.t()) :: %{String.t() => String.t()}
  def metadata(%Setup{options: options}) do
    %{
      "version" => "#{@version}",
      "robots" => Enum.map_join(options.robots, ",", &Atom.to_string/1),
      "map" => options.map,
      "seed" => "#{options.seed}"
    }
  end

  @doc "The content of the start's message."
  @spec start(Setup.t()) :: binary()
  def start(%Setup{robots: robots} = setup) do
    names = Enum.uniq(for %{id: id, profile: body} <- robots, name <- [id, body.name], do: name)
    start = write(%{setup | map: nil})
    write({:convoy, @version, Enum.map(names, &Atom.to_string/1), start})
  end

  defp write(term), do: :erlang.term_to_binary(term, [:deterministic, compressed: 1])

  @doc "The content of a tick's message."
  @spec tick(tick()) :: binary()
  def tick({at_ms, entries}),
    do: :erlang.term_to_binary({at_ms, Tick.pack(entries)}, [:deterministic])

  @doc "The start from its message, whose names become known to this program: a reader need not know the robots before."
  @spec read_start(binary()) :: {:ok, Setup.t()} | {:error, line :: String.t()}
  def read_start(bytes) do
    case Shared.read(bytes) do
      {:ok, {:convoy, @version, names, start}} when is_binary(start) ->
        with {:ok, _left} <- Shared.know(names),
             {:ok, %Setup{world: %{map: map}} = setup} <- Shared.read(start) do
          {:ok, %{setup | map: map}}
        else
          {:error, line} -> {:error, line}
          _other -> Shared.refuse(:error, :convoy, @version)
        end

      other ->
        Shared.refuse(other, :convoy, @version)
    end
  end

  @doc "A tick from its message."
  @spec read_tick(binary()) :: {:ok, tick()} | {:error, line :: String.t()}
  def read_tick(bytes) do
    with {:ok, {at_ms, packed}} when is_integer(at_ms) <- Shared.read(bytes),
         {:ok, entries} <- Tick.unpack(packed) do
      {:ok, {at_ms, entries}}
    else
      _other -> {:error, "has a tick that this program did not record"}
    end
  end
end
