defmodule Swarm.Link.Presence do
  @moduledoc """
  A process's place in the directory. It enters its groups, watches the directory, and enters a new
  one by itself, with back-off while there is none: the process gets `:enter` then. A process that
  left stays out.
  """
  alias Swarm.Directory

  @retry_ms 100
  @longest_retry_ms 5_000

  @enforce_keys [:groups]
  defstruct @enforce_keys ++ [scope: nil, retry_ms: @retry_ms, left?: false]

  @type t :: %__MODULE__{
          groups: [Directory.group()],
          scope: reference() | nil,
          retry_ms: pos_integer(),
          left?: boolean()
        }

  @doc "In none of these groups yet."
  @spec new([Directory.group()]) :: t()
  def new(groups), do: %__MODULE__{groups: groups}

  @doc "Enters the calling process, now or as soon as there is a directory; says whether it is in."
  @spec enter(t()) :: {entered? :: boolean(), t()}
  def enter(%__MODULE__{left?: true} = presence), do: {false, presence}
  def enter(%__MODULE__{scope: scope} = presence) when scope != nil, do: {true, presence}

  def enter(presence) do
    scope = Directory.monitor()

    case Directory.enter(self(), presence.groups) do
      :ok ->
        {true, %{presence | scope: scope, retry_ms: @retry_ms}}

      {:error, :down} ->
        Process.demonitor(scope, [:flush])
        {false, retry(presence)}
    end
  end

  @doc "What has become of it when a monitored process ended: perhaps the directory."
  @spec down(t(), reference()) :: {:ok, t()} | :error
  def down(%__MODULE__{scope: scope} = presence, scope),
    do: {:ok, retry(%{presence | scope: nil})}

  def down(_presence, _another), do: :error

  @doc "Leaves the groups for good."
  @spec leave(t()) :: t()
  def leave(%__MODULE__{left?: true} = presence), do: presence

  def leave(presence) do
    if presence.scope, do: Process.demonitor(presence.scope, [:flush])
    Directory.leave(self(), presence.groups)
    %{presence | scope: nil, left?: true}
  end

  defp retry(presence) do
    Process.send_after(self(), :enter, presence.retry_ms)
    %{presence | retry_ms: min(2 * presence.retry_ms, @longest_retry_ms)}
  end
end
