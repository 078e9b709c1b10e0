defmodule Console.Live.Trial do
  @moduledoc """
  A trial in real time: the lockstep run, one step of 100 ms each 100 ms.

  It never runs faster to make up for lost time: on a machine too slow for its fleet the run is
  slow, and an answer may take as long as a step.
  """
  use GenServer
  alias Hal.Ticker
  @behaviour Console.Live

  @step_ms 100

  @doc "Starts the run of a new trial; the error says in one line what is wrong with its options."
  @spec start_link(module(), map()) :: {:ok, pid()} | {:error, String.t()}
  def start_link(module, options) do
    with {:ok, trial} <- module.new(options) do
      GenServer.start_link(__MODULE__, {module, trial})
    end
  end

  @impl Console.Live
  def scene(live), do: GenServer.call(live, :scene, :infinity)

  @impl Console.Live
  def command(live, command), do: GenServer.call(live, {:command, command}, :infinity)

  # In lockstep nothing can be killed from outside.
  @impl Console.Live
  def ended(_live), do: nil

  @impl Console.Live
  def result(live), do: GenServer.call(live, :result, :infinity)

  @impl Console.Live
  def lines(_live), do: ["all robots live in process #{System.pid()}, in lockstep; see --nodes"]

  @impl Console.Live
  def stop(live), do: GenServer.stop(live)

  @impl GenServer
  def init({module, trial}) do
    {:ok, %{module: module, trial: trial, ticker: Ticker.start(:step, @step_ms, 0)}}
  end

  @impl GenServer
  def handle_call(:scene, _from, state), do: {:reply, state.module.scene(state.trial), state}
  def handle_call(:result, _from, state), do: {:reply, state.module.result(state.trial), state}

  def handle_call({:command, command}, _from, state) do
    case carry_out(command, state) do
      {:ok, trial} -> {:reply, {:ok, "done"}, %{state | trial: trial}}
      {:error, line} -> {:reply, {:error, line}, state}
    end
  end

  @impl GenServer
  def handle_info(:step, state) do
    trial = state.module.step(state.trial)
    {:noreply, %{state | trial: trial, ticker: Ticker.next(state.ticker)}}
  end

  defp carry_out({:kill, :leader}, %{module: module, trial: trial}) do
    case module.scene(trial).leader do
      nil -> {:error, "there is no leader to kill yet"}
      leader -> {:ok, module.kill(trial, leader)}
    end
  end

  defp carry_out({:kill, robot}, %{module: module, trial: trial}) do
    if robot in module.living(trial),
      do: {:ok, module.kill(trial, robot)},
      else: {:error, "#{robot} is already dead"}
  end

  defp carry_out({:landmark, :none}, _state),
    do: {:error, "in lockstep the landmark can be moved, but not removed"}

  defp carry_out({:landmark, place}, %{module: module, trial: trial}),
    do: module.move(trial, place)

  defp carry_out({:formation, {kind, spacing}}, %{module: module, trial: trial}) do
    {_kind, present} = module.scene(trial).formation
    {:ok, module.command(trial, :all, {:formation, kind, spacing || present})}
  end

  defp carry_out({:tell, target, "stop"}, state), do: tell(target, :stop, state)
  defp carry_out({:tell, target, "start"}, state), do: tell(target, :start, state)
  defp carry_out(latch, state) when latch in [:estop, :reset], do: tell(:all, latch, state)

  defp carry_out({:tell, _target, text}, _state),
    do: {:error, "in lockstep robots accept stop and start, not #{text}"}

  defp tell(:all, command, %{module: module, trial: trial}),
    do: {:ok, module.command(trial, :all, command)}

  defp tell(robots, command, %{module: module, trial: trial}),
    do: {:ok, Enum.reduce(robots, trial, &module.command(&2, &1, command))}
end
