defmodule Console.Live.Trial do
  @moduledoc """
  A trial in real time: the lockstep run, one step of 100 ms each 100 ms.

  It never hurries to make up for lost time: on a machine too slow for its fleet the run is slow.
  """
  use GenServer
  @behaviour Console.Live

  @step_ms 100

  @doc "Starts the run of a new trial, or says in one line what is wrong with its options."
  @spec start_link(module(), map()) :: {:ok, pid()} | {:error, String.t()}
  def start_link(module, options) do
    with {:ok, trial} <- module.new(options) do
      GenServer.start_link(__MODULE__, {module, trial})
    end
  end

  @impl Console.Live
  def scene(live), do: GenServer.call(live, :scene)

  @impl Console.Live
  def command(live, command), do: GenServer.call(live, {:command, command})

  @impl Console.Live
  def result(live), do: GenServer.call(live, :result)

  @impl GenServer
  def init({module, trial}) do
    send(self(), :step)
    {:ok, %{module: module, trial: trial, next_ms: now()}}
  end

  @impl GenServer
  def handle_call(:scene, _from, state), do: {:reply, state.module.scene(state.trial), state}
  def handle_call(:result, _from, state), do: {:reply, state.module.result(state.trial), state}

  def handle_call({:command, command}, _from, state) do
    with true <- function_exported?(state.module, :command, 2),
         {:ok, trial} <- state.module.command(state.trial, command) do
      {:reply, {:ok, "done"}, %{state | trial: trial}}
    else
      false -> {:reply, {:error, "this run takes no commands"}, state}
      {:error, line} -> {:reply, {:error, line}, state}
    end
  end

  @impl GenServer
  def handle_info(:step, state) do
    trial = state.module.step(state.trial)
    next_ms = max(state.next_ms + @step_ms, now())
    Process.send_after(self(), :step, next_ms, abs: true)
    {:noreply, %{state | trial: trial, next_ms: next_ms}}
  end

  defp now, do: System.monotonic_time(:millisecond)
end
