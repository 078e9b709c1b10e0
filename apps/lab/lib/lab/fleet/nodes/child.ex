defmodule Lab.Fleet.Nodes.Child do
  @moduledoc false
  # Starts a node: its process of the operating system behind a port (`Vm.open/2`). It lives no longer than we do, even
  # frozen.
  alias Lab.Fleet.Nodes
  alias Lab.Fleet.Nodes.Command

  @kept_bytes 4_000
  @end_ms 2_000

  @enforce_keys [:node, :port, :pid]
  defstruct @enforce_keys ++ [up: nil, said: ""]

  @typedoc "`up` holds what it told when it was there; `said` the last of what it printed."
  @type t :: %__MODULE__{
          node: node(),
          port: port(),
          pid: pos_integer(),
          up: map() | nil,
          said: String.t()
        }

  @doc "Starts a node, in the calling process; `home` holds its cookie."
  @spec start(Nodes.Config.t(), Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def start(%Nodes.Config{} = config, home) do
    arguments = Command.arguments(Application.get_env(:swarm, :formations, []))

    case Vm.open(arguments, [{"HOME", home}, {"ERL_CRASH_DUMP_SECONDS", "0"}]) do
      {:ok, port, pid} ->
        true = Port.command(port, Nodes.Config.line(config))
        {:ok, %__MODULE__{node: config.node, port: port, pid: pid}}

      :error ->
        {:error, "#{config.node} cannot be started: erl does not run"}
    end
  end

  @doc "It printed something."
  @spec said(t(), binary()) :: t()
  def said(child, text) do
    all = child.said <> text
    size = byte_size(all)
    kept = min(size, @kept_bytes)
    %{child | said: binary_part(all, size - kept, kept)}
  end

  @doc "The last line that it printed, for a message to people."
  @spec last_line(t()) :: String.t()
  def last_line(child) do
    case child.said |> String.split("\n", trim: true) |> List.last() do
      nil ->
        "it printed nothing"

      line ->
        if String.valid?(line), do: String.slice(line, 0, 200), else: inspect(line, limit: 200)
    end
  end

  @doc "Kills it, frozen or not, and without asking it."
  @spec kill(t()) :: :ok
  def kill(child), do: Vm.signal("#{child.pid}", "KILL")

  @doc """
  Waits until these, which were killed, are gone, 2 s at most: a search for them after we have
  ended finds none. In the process that started them.
  """
  @spec await_ends([t()]) :: :ok
  def await_ends(children) do
    await(for(child <- children, do: child.port), Hal.Clock.now_ms() + @end_ms)
  end

  defp await([], _deadline), do: :ok

  defp await([port | ports], deadline) do
    receive do
      {^port, {:exit_status, _status}} -> await(ports, deadline)
    after
      max(deadline - Hal.Clock.now_ms(), 0) -> await(ports, deadline)
    end
  end
end
