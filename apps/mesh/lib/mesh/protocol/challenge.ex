defmodule Mesh.Protocol.Challenge do
  @moduledoc """
  Describes how a node learns that another speaks now, and how its clock stands (`Mesh.Protocol.ClockOffset`).
  Pure.

  A challenge is a signed datagram, and so carries its sender's session and time; a node answers
  with these two, signed in turn. Nothing has to be remembered of a challenge: only an owner of the
  fleet's key could have made it, and its answer names the time at which it was made. A node that
  does not know the challenger's clock either challenges it in the same datagram, so that three
  datagrams make two nodes known to each other:

      a --- beacon: I am here -------> b
      a <-- challenge ---------------- b
      a --- challenge and answer ----> b   believes a
      a <-- answer ------------------- b
      believes b

  All challenges and answers of a fleet have one size (`Mesh.Protocol.Packet.padding/1`), so that
  an answer is never larger than what asked for it.
  """

  @typedoc "The session and the time of the challenge that is answered."
  @type echo :: {session :: non_neg_integer(), time_ms :: integer()}

  @doc """
  A payload: the answer to that challenge, or `nil` where none is answered.

      iex> alias Mesh.Protocol.Challenge
      iex> for echo <- [nil, {7, -12_345}], do: Challenge.read(Challenge.payload(echo))
      [{:ok, nil}, {:ok, {7, -12_345}}]
  """
  @spec payload(echo() | nil) :: binary()
  def payload(nil), do: <<0, 0::64, 0::64>>
  def payload({session, time_ms}), do: <<1, session::64, time_ms::signed-64>>

  @doc "The other way round; what follows the payload is padding."
  @spec read(binary()) :: {:ok, echo() | nil} | :error
  def read(<<1, session::64, time_ms::signed-64, _padding::binary>>),
    do: {:ok, {session, time_ms}}

  def read(<<0, 0::64, 0::64, _padding::binary>>), do: {:ok, nil}
  def read(_other), do: :error
end
