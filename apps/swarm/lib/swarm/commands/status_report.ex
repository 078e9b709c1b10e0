defmodule Swarm.Commands.StatusReport do
  @moduledoc false
  # The status of robots (`Swarm.status`): from their answers, else from their rows.
  alias Swarm.{Blackboard, Commands, Status}
  alias Swarm.Transport

  # Robots known by way of others, heard of as recently as one that is not gone.
  @there_ms 2_000

  @doc "All robots: those in the directory, and those whose rows arrive by way of others."
  @spec all() :: [Status.t()]
  def all do
    robots = Transport.robots()
    answers = Commands.Client.ask(robots, :status)

    relayed =
      for id <- Blackboard.robots() -- robots, {:ok, status} <- [row(id, @there_ms)], do: status

    Enum.sort_by(for(id <- robots, do: one(id, answers)) ++ relayed, & &1.robot)
  end

  @doc "One robot, named as in `Swarm`."
  @spec one(term()) :: Status.t() | {:error, line :: String.t()}
  def one(robot) do
    case Commands.robots(robot) do
      {:ok, [id]} ->
        with %Status{state: :no_answer} <- one(id, Commands.Client.ask([id], :status)),
             do: {:error, "#{id} does not answer"}

      {:ok, _several} ->
        {:error, "status/1 takes one robot; status/0 shows all"}

      unknown ->
        known(robot) || unknown
    end
  end

  # A robot that is gone, but not forgotten.
  defp known(robot) do
    with id when id != nil <- Enum.find(Blackboard.robots(), &(&1 == robot or "#{&1}" == robot)),
         {:ok, status} <- row(id) do
      status
    else
      _never_heard_of -> nil
    end
  end

  defp one(id, answers) do
    with %{^id => %Status{} = status} <- answers do
      status
    else
      _silent ->
        case row(id) do
          {:ok, status} -> status
          :error -> %Status{robot: id, state: :no_answer}
        end
    end
  end

  defp row(id, max_age_ms \\ :infinity) do
    with {:ok, row, age_ms} <- Blackboard.get(id, :status, max_age_ms),
         do: Status.Row.decode(id, row, age_ms)
  end
end
