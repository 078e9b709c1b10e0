defmodule Bench.Mesh.Agent do
  @moduledoc false
  # Answers on a robot (`Agents.Responder`), to be measured, and takes part in rounds in which each writes to every other.
  # To start a round, ask all with `{:round, others}`; an agent answers when it has heard from all others.
  @behaviour Agents.Responder
  alias Agents.{Conversation, Envelope}

  @doc "The name of the service."
  @spec service() :: atom()
  def service, do: :bench

  @impl Agents.Responder
  def init(robot, _argument), do: %{robot: robot, heard: 0, asked: nil}

  @impl Agents.Responder
  def handle(%{content: :ping}, s), do: {{:inform, :pong}, s}

  def handle(%{content: {:round, robots}} = asked, s) do
    word = Envelope.new(:inform, s.robot, :word)
    others = List.delete(robots, s.robot)
    for other <- others, do: Conversation.tell({other, service()}, word)
    complete(%{s | asked: {asked, length(others)}})
  end

  def handle(%{content: :word}, s), do: complete(%{s | heard: s.heard + 1})
  def handle(_other, s), do: {:noreply, s}

  # Messages of other agents may arrive before the question.
  defp complete(%{asked: {asked, all}, heard: all} = s) do
    Conversation.post(asked.reply_to, Envelope.reply(asked, :inform, s.robot, :done))
    {:noreply, %{s | heard: 0, asked: nil}}
  end

  defp complete(s), do: {:noreply, s}
end
