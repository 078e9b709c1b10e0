defmodule Mesh.Nonblocking do
  @moduledoc """
  Sends to processes that may be on another node, without ever waiting for a node that has gone
  silent. Without these options, a send waits while the buffer is full, or dials a node that is
  gone. What cannot be sent now is lost.
  """

  @doc "Casts to a `GenServer`, wherever it is."
  @spec cast(pid() | {atom(), node()}, term()) :: :ok
  def cast(pid, term) do
    :erlang.send(pid, {:"$gen_cast", term}, [:nosuspend, :noconnect])
    :ok
  end

  @doc """
  Calls a process of this node for a person: if it has ended, or does not answer within 5 s, the
  error is one line that names it by `whose`.
  """
  @spec call(GenServer.server(), term(), whose :: String.t()) ::
          term() | {:error, line :: String.t()}
  def call(server, request, whose) do
    GenServer.call(server, request)
  catch
    :exit, {_reason, {GenServer, :call, _arguments}} -> {:error, "#{whose} does not answer"}
  end

  @doc "Sends an answer to the caller with this reference, an alias."
  @spec answer(reference(), term()) :: :ok
  def answer(ref, answer) do
    :erlang.send(ref, {ref, answer}, [:nosuspend, :noconnect])
    :ok
  end
end
