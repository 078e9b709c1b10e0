defmodule Swarm.Post do
  @moduledoc """
  How one process sends to another that may be on another node: so that nothing ever waits for a
  node that has gone silent. Without these options a send waits for a full buffer, or dials a node
  that is gone. What cannot be sent now is lost.
  """

  @doc "Casts to a `GenServer`, wherever it is."
  @spec cast(pid() | {atom(), node()}, term()) :: :ok
  def cast(pid, term) do
    :erlang.send(pid, {:"$gen_cast", term}, [:nosuspend, :noconnect])
    :ok
  end

  @doc "Answers to who asked with this reference, an alias (`Swarm.Door.Ask`)."
  @spec answer(reference(), term()) :: :ok
  def answer(ref, answer) do
    :erlang.send(ref, {ref, answer}, [:nosuspend, :noconnect])
    :ok
  end
end
