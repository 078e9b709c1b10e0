defmodule Swarm.Message do
  @moduledoc """
  What robots say to each other: who, what kind, and a body whose shape the kind fixes.

  Whatever comes from outside passes `check/1` once, at the ear: a malformed message is an error
  with a reason, to be dropped and counted, and nothing behind the ear has to doubt a message.
  Nothing becomes an atom here. Commands are a person's, and come by another way (`Swarm`): no
  robot can start another by a message.

  | kind | body |
  |---|---|
  | `:heartbeat` | `Swarm.Heartbeat` |
  | `:round` | one `Swarm.Round` letter |
  | `:place` | `Swarm.Anchor`: a parent tells its child where the leader is supposed to be |
  """
  alias Swarm.{Anchor, Heartbeat, Round, Shape}

  @enforce_keys [:from, :kind, :body]
  defstruct @enforce_keys

  @type kind :: :heartbeat | :round | :place
  @type t :: %__MODULE__{
          from: atom(),
          kind: kind(),
          body: Heartbeat.t() | Round.Letter.t() | Anchor.t()
        }

  @doc """
  A message.

      iex> beat = %Swarm.Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
      iex> Swarm.Message.new(:mag1, :heartbeat, beat).kind
      :heartbeat
  """
  @spec new(atom(), kind(), Heartbeat.t() | Round.Letter.t() | Anchor.t()) :: t()
  def new(from, kind, body), do: %__MODULE__{from: from, kind: kind, body: body}

  @doc """
  Whether a term is a message that a robot may act on.

      iex> Swarm.Message.check(%{junk: 1})
      {:error, :not_a_message}
      iex> Swarm.Message.check(Swarm.Message.new(:mag1, :heartbeat, :nonsense))
      {:error, :heartbeat}
  """
  @spec check(term()) :: {:ok, t()} | {:error, :not_a_message | kind()}
  def check(%__MODULE__{from: from, kind: kind, body: body} = message)
      when kind in [:heartbeat, :round, :place] do
    cond do
      not (Shape.whole?(message, __MODULE__) and Shape.name?(from)) -> {:error, :not_a_message}
      valid?(kind, body) -> {:ok, message}
      true -> {:error, kind}
    end
  end

  def check(_term), do: {:error, :not_a_message}

  defp valid?(:heartbeat, body), do: Heartbeat.valid?(body)
  defp valid?(:round, body), do: Round.Letter.valid?(body)
  defp valid?(:place, body), do: Anchor.valid?(body)
end
