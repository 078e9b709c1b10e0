defmodule Swarm.Entry do
  @moduledoc """
  How a process stays in groups of the directory, which is empty after it has restarted: the process
  enters, watches the directory, and enters the next one. Keep the entry in the process's state, and
  show it every message that may be about it.

      def init(options), do: {:ok, %{entry: Swarm.Entry.enter([{:service, :battery}])}}

      def handle_info(message, s) do
        case Swarm.Entry.arrived(s.entry, message) do
          {:ok, entry} -> {:noreply, %{s | entry: entry}}
          :other -> …
        end
      end
  """
  alias Swarm.Directory

  @retry_ms 100
  @longest_retry_ms 5_000

  @enforce_keys [:groups, :token]
  defstruct @enforce_keys ++ [scope: nil, retry_ms: @retry_ms]

  @type t :: %__MODULE__{
          groups: [Directory.group() | tuple()],
          token: reference(),
          scope: reference() | nil,
          retry_ms: pos_integer()
        }

  @doc "Enters the calling process into these groups, now or as soon as there is a directory."
  @spec enter([Directory.group() | tuple()]) :: t()
  def enter(groups), do: try_to(%__MODULE__{groups: groups, token: make_ref()})

  @doc "Whether a message was about the entry."
  @spec arrived(t(), message :: term()) :: {:ok, t()} | :other
  def arrived(%{scope: scope} = entry, {:DOWN, scope, :process, _pid, _reason}),
    do: {:ok, retry(%{entry | scope: nil})}

  def arrived(%{token: token} = entry, {__MODULE__, token}), do: {:ok, try_to(entry)}
  def arrived(_entry, _message), do: :other

  defp try_to(entry) do
    scope = Directory.monitor()

    case Directory.enter(self(), entry.groups) do
      :ok ->
        %{entry | scope: scope, retry_ms: @retry_ms}

      {:error, :down} ->
        Process.demonitor(scope, [:flush])
        retry(entry)
    end
  end

  defp retry(entry) do
    Process.send_after(self(), {__MODULE__, entry.token}, entry.retry_ms)
    %{entry | retry_ms: min(2 * entry.retry_ms, @longest_retry_ms)}
  end
end
