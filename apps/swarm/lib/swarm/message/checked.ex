defmodule Swarm.Message.Checked do
  @moduledoc """
  Checks a message once a node instead of once a robot: what sends or delivers it to several robots of this node marks
  it as checked, with a reference that only this node knows. What comes without that mark is checked by each robot.
  """
  alias Swarm.Message

  @doc "Makes the reference of this node; the application does, before it starts a robot."
  @spec begin() :: :ok
  def begin, do: :persistent_term.put(__MODULE__, make_ref())

  @doc "A message with the mark, or as it is if it does not pass `Swarm.Message.check/1`."
  @spec mark(Message.t()) :: term()
  def mark(message) do
    case Message.check(message) do
      {:ok, message} -> {reference() || begun(), message}
      {:error, _kind} -> message
    end
  end

  # In a trial no application has made it.
  defp begun do
    :ok = begin()
    reference()
  end

  @doc """
  The message of a term from outside, as `Swarm.Message.check/1` tells it, unless it has the mark of this node.

      iex> Swarm.Message.Checked.open({make_ref(), :junk})
      {:error, :not_a_message}
  """
  @spec open(term()) :: {:ok, Message.t()} | {:error, :not_a_message | Message.kind()}
  def open({mark, message} = term) when is_reference(mark),
    do: if(mark == reference(), do: {:ok, message}, else: Message.check(term))

  def open(term), do: Message.check(term)

  defp reference, do: :persistent_term.get(__MODULE__, nil)
end
