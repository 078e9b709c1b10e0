defmodule Hal.HardenedServer.Drops do
  @moduledoc false
  # Counts what the process of a `Hal.HardenedServer` drops, and reports it at most once a minute.
  #
  # Both the loop and the module's callbacks drop messages, and know nothing of each other's state:
  # so the count is in the process dictionary.
  alias Hal.Event

  @every_ms 60_000

  @doc "Names the calling process for its reports."
  @spec name(module(), name :: {:local, atom()} | {:via, module(), term()} | pid()) :: :ok
  def name(module, name) do
    Process.put({__MODULE__, :who}, {module, plain(name)})
    :ok
  end

  defp plain({:local, name}), do: name
  defp plain({:via, _module, name}), do: name
  defp plain(pid), do: pid

  @doc "How many messages the calling process has dropped so far."
  @spec count() :: non_neg_integer()
  def count, do: elem(counted(), 0)

  @doc "Counts one more."
  @spec add() :: :ok
  def add do
    {count, due_ms} = counted()
    now_ms = Hal.Clock.now_ms()

    if due_ms == nil or now_ms >= due_ms do
      {module, name} = Process.get({__MODULE__, :who}, {nil, self()})
      about = %{server: module, name: name}
      Event.execute([:hal, :server, :dropped], %{at_ms: now_ms, count: count + 1}, about)
      note(count + 1, now_ms + @every_ms)
    else
      note(count + 1, due_ms)
    end
  end

  defp counted, do: Process.get(__MODULE__, {0, nil})

  defp note(count, due_ms) do
    Process.put(__MODULE__, {count, due_ms})
    :ok
  end
end
