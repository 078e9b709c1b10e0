defmodule Console.Live.Paced do
  @moduledoc """
  Runs a live fleet by the functions of `Sim.Trial`, so that a run without a view uses the same code: one step waits a
  tenth of a second.
  """
  alias Sim.Fleet

  @step_ms 100

  @doc """
  Starts the fleet; with `nodes: true` each robot runs in an operating system process of its own.
  """
  @spec new(map()) :: {:ok, pid()} | {:error, String.t()}
  defdelegate new(options), to: Fleet, as: :start_link

  @doc "Waits a tenth of a second; if the fleet has crashed, this process ends with it."
  @spec step(pid()) :: pid()
  def step(fleet) do
    receive do
    after
      @step_ms -> fleet
    end
  end

  @doc "Whether the run is over."
  @spec done?(pid()) :: boolean()
  defdelegate done?(fleet), to: Fleet

  @doc "Why the run has ended before its time, in one line; `nil` if it has not."
  @spec ended(pid()) :: String.t() | nil
  defdelegate ended(fleet), to: Fleet

  @doc "The current scene of the fleet."
  @spec scene(pid()) :: Sim.Scene.t()
  defdelegate scene(fleet), to: Fleet

  @doc "The result for the report."
  @spec result(pid()) :: map()
  defdelegate result(fleet), to: Fleet

  @doc "How to reach its processes, as lines of text."
  @spec lines(pid()) :: [String.t()]
  defdelegate lines(fleet), to: Fleet

  @doc "Ends its processes, and returns when they are gone."
  @spec stop(pid()) :: :ok
  defdelegate stop(fleet), to: Fleet
end
