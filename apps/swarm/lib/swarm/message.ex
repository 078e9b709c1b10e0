defmodule Swarm.Message do
  @moduledoc """
  What robots say to each other: who, what kind, and a body whose shape the kind fixes.

  Whatever comes from outside passes `check/2` once, at the ear: a malformed message is an error
  with a reason, to be dropped and counted, and nothing behind the ear has to doubt a message.
  Names are compared with the fleet's known names; nothing becomes an atom here.

  | kind | body |
  |---|---|
  | `:heartbeat` | `Swarm.Heartbeat` |
  | `:round` | one `Swarm.Round` letter |
  | `:place` | `Swarm.Anchor`: a parent tells its child where the leader is supposed to be |
  | `:command` | a `Robot.Command` for the mission |
  """
  alias Swarm.{Anchor, Heartbeat, Round, Shape}

  @kinds [:heartbeat, :round, :place, :command]

  @enforce_keys [:from, :kind, :body]
  defstruct @enforce_keys

  @type kind :: :heartbeat | :round | :place | :command
  @type t :: %__MODULE__{from: atom(), kind: kind(), body: term()}

  @doc """
  A message.

      iex> Swarm.Message.new(:mag1, :command, :start).kind
      :command
  """
  @spec new(atom(), kind(), term()) :: t()
  def new(from, kind, body), do: %__MODULE__{from: from, kind: kind, body: body}

  @doc """
  Whether a term is a message that a robot may act on.

      iex> Swarm.Message.check(%{junk: 1})
      {:error, :not_a_message}
      iex> Swarm.Message.check(Swarm.Message.new(:mag1, :heartbeat, :nonsense))
      {:error, :heartbeat}
  """
  @spec check(term()) :: {:ok, t()} | {:error, :not_a_message | kind()}
  def check(%__MODULE__{from: from, kind: kind, body: body} = message) when is_atom(from) do
    case Shape.whole?(message, __MODULE__) and valid?(kind, body) do
      true -> {:ok, message}
      false when kind in @kinds -> {:error, kind}
      false -> {:error, :not_a_message}
      :unknown -> {:error, :not_a_message}
    end
  end

  def check(_term), do: {:error, :not_a_message}

  defp valid?(:heartbeat, body), do: Heartbeat.valid?(body)
  defp valid?(:round, body), do: Round.Letter.valid?(body)
  defp valid?(:place, body), do: Anchor.valid?(body)
  defp valid?(:command, body), do: is_struct(body) or is_atom(body) or is_tuple(body)
  defp valid?(_kind, _body), do: :unknown
end
