defmodule Swarm.Directory.Membership do
  @moduledoc """
  Keeps a process in groups of the directory, which is empty after a restart: the process enters,
  monitors the directory, and enters the next one, with back-off while there is none. Keep the
  entry in the process's state, and pass it every message that may be about it. A process may have
  several entries: each knows its own messages.

      def init(options), do: {:ok, %{entry: Swarm.Directory.Membership.enter([{:service, :battery}])}}

      def handle_info(message, s) do
        case Swarm.Directory.Membership.arrived(s.entry, message) do
          {:ok, entry} -> {:noreply, %{s | entry: entry}}
          :other -> …
        end
      end
  """
  alias Swarm.Directory

  @retry_ms 100
  @longest_retry_ms 5_000

  @enforce_keys [:pid, :groups, :token]
  defstruct @enforce_keys ++ [scope: nil, retry_ms: @retry_ms, left?: false]

  @type t :: %__MODULE__{
          pid: pid(),
          groups: [Directory.group()],
          token: reference(),
          scope: reference() | nil,
          retry_ms: pos_integer(),
          left?: boolean()
        }

  @doc "Adds a process of this node to these groups, by default the calling one, now or as soon as there is a directory."
  @spec enter([Directory.group()], pid()) :: t()
  def enter(groups, pid \\ self()),
    do: try_to(%__MODULE__{pid: pid, groups: groups, token: make_ref()})

  @doc "Whether the process is in its groups now."
  @spec in?(t()) :: boolean()
  def in?(entry), do: entry.scope != nil

  @doc "Leaves the groups for good."
  @spec leave(t()) :: t()
  def leave(%{left?: true} = entry), do: entry

  def leave(entry) do
    if entry.scope, do: Process.demonitor(entry.scope, [:flush])
    Directory.leave(entry.pid, entry.groups)
    %{entry | scope: nil, left?: true}
  end

  @doc "Handles a message if it was about the entry."
  @spec arrived(t(), message :: term()) :: {:ok, t()} | :other
  def arrived(%{scope: scope} = entry, {:DOWN, scope, :process, _pid, _reason})
      when scope != nil,
      do: {:ok, retry(%{entry | scope: nil})}

  def arrived(%{token: token, left?: true} = entry, {__MODULE__, token}), do: {:ok, entry}
  def arrived(%{token: token} = entry, {__MODULE__, token}), do: {:ok, try_to(entry)}
  def arrived(_entry, _message), do: :other

  defp try_to(entry) do
    scope = Directory.monitor()

    case Directory.enter(entry.pid, entry.groups) do
      :ok ->
        %{entry | scope: scope, retry_ms: @retry_ms}

      {:error, :down} ->
        Process.demonitor(scope, [:flush])
        retry(entry)
    end
  end

  @doc "The message that triggers the next try, which must not be dropped."
  @spec timer(t()) :: term()
  def timer(entry), do: {__MODULE__, entry.token}

  defp retry(entry) do
    Process.send_after(self(), timer(entry), entry.retry_ms)
    %{entry | retry_ms: min(2 * entry.retry_ms, @longest_retry_ms)}
  end
end
