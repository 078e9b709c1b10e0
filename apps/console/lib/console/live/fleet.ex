defmodule Console.Live.Fleet do
  @moduledoc """
  A fleet of whole robots in real time: every robot its own tree of processes, commanded through the
  door that real ones have (`Swarm`).
  """
  @behaviour Console.Live
  alias Sim.Fleet

  @doc "Starts a fleet, or says in one line what is wrong with its options."
  @spec start_link(map()) :: {:ok, pid()} | {:error, String.t()}
  def start_link(options), do: Fleet.start_link(options)

  @impl Console.Live
  def scene(live), do: Fleet.scene(live)

  @impl Console.Live
  def result(live), do: Fleet.result(live)

  @impl Console.Live
  def command(live, command) do
    case carry_out(command, live) do
      :ok -> {:ok, "done"}
      {:error, line} -> {:error, line}
    end
  end

  defp carry_out({:kill, who}, live), do: Fleet.kill(live, who)
  defp carry_out({:landmark, :none}, live), do: Fleet.move_landmark(live, nil)
  defp carry_out({:landmark, place}, live), do: Fleet.move_landmark(live, place)
  defp carry_out({:tell, target, text}, _live), do: Swarm.tell(target, text)
  defp carry_out(:estop, _live), do: Swarm.estop()
  defp carry_out(:reset, _live), do: Swarm.reset()

  # Another shape keeps the distance that the robots have now.
  defp carry_out({:formation, {kind, spacing}}, live) do
    {_kind, present} = Fleet.scene(live).formation
    Swarm.formation(kind, spacing: spacing || present)
  end
end
