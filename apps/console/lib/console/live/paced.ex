defmodule Console.Live.Paced do
  @moduledoc """
  A live fleet with the functions of `Sim.Trial`, so that a run without a view uses the same code:
  one step waits a tenth of a second.
  """
  alias Sim.Fleet

  @step_ms 100

  @doc "Starts the fleet; with `nodes: true` each robot in a process of the operating system of its own."
  @spec new(map()) :: {:ok, pid()} | {:error, String.t()}
  defdelegate new(options), to: Fleet, as: :start_link

  @doc "A tenth of a second later; when the fleet has fallen, this process ends with it."
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

  @doc "The fleet as it is now."
  @spec scene(pid()) :: Sim.Scene.t()
  defdelegate scene(fleet), to: Fleet

  @doc "The result for the report."
  @spec result(pid()) :: map()
  defdelegate result(fleet), to: Fleet

  @doc "How to reach its processes."
  @spec lines(pid()) :: [String.t()]
  defdelegate lines(fleet), to: Fleet

  @doc "Ends them, and returns when they are gone."
  @spec stop(pid()) :: :ok
  defdelegate stop(fleet), to: Fleet
end
