defmodule Swarm.Message do
  @moduledoc """
  Carries a message between robots: its sender, its kind, and a body whose shape depends on the kind.

  Whatever comes from outside passes `check/1` once, at the receiver: a malformed message is an
  error with a reason, to be dropped and counted, and nothing behind the receiver needs to check a
  message again. Nothing becomes an atom here. Commands come from people, by another way
  (`Swarm`): no robot can start another by a message.

  | kind | body |
  |---|---|
  | `:heartbeat` | `Swarm.Membership.Heartbeat` |
  | `:round` | one `Swarm.Agreement.Round` letter |
  | `:claim` | `Robot.Mission.Claim`, as in heartbeats, for some robots only: it travels faster than those, or farther |
  | `:mission` | `Robot.Mission.Letter`, a message of a mission's own; the mission's table checks what it says |
  | `:relay` | a whole heartbeat or letter of another robot, for one that does not hear it (`.Forwarder`) |

  `hops` counts the robots that have passed a message on, at most three.
  """
  alias Swarm.Agreement.Round
  alias Swarm.Membership.Heartbeat
  alias Swarm.Wire

  @most_hops 3

  @enforce_keys [:from, :kind, :body]
  defstruct @enforce_keys ++ [hops: 0]

  @type kind :: :heartbeat | :round | :claim | :mission | :relay
  @type t :: %__MODULE__{
          from: atom(),
          kind: kind(),
          body:
            Heartbeat.t()
            | Round.Letter.t()
            | Robot.Mission.Claim.t()
            | Robot.Mission.Letter.t()
            | t(),
          hops: 0..3
        }

  @doc """
  Builds a message.

      iex> beat = %Swarm.Membership.Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
      iex> Swarm.Message.new(:mag1, :heartbeat, beat).kind
      :heartbeat
  """
  @spec new(
          atom(),
          kind(),
          Heartbeat.t()
          | Round.Letter.t()
          | Robot.Mission.Claim.t()
          | Robot.Mission.Letter.t()
          | t()
        ) :: t()
  def new(from, kind, body), do: %__MODULE__{from: from, kind: kind, body: body}

  @doc "What a robot's mission sends, as a message of this robot."
  @spec of(atom(), t() | Robot.Mission.Letter.t() | Robot.Mission.Claim.t()) :: t()
  def of(from, %Robot.Mission.Letter{} = letter), do: new(from, :mission, letter)
  def of(from, %Robot.Mission.Claim{} = claim), do: new(from, :claim, claim)
  def of(_from, %__MODULE__{} = message), do: message

  @doc """
  Another robot's message as this robot passes it on; `:error` if it has been passed on often
  enough.

      iex> letter = %Swarm.Agreement.Round.Letter{id: {1, 1, :mag1}, view: [:mag1], remaining_ms: 9, purpose: :search}
      iex> {:ok, relay} = Swarm.Message.pass_on(Swarm.Message.new(:mag1, :round, letter), :mag2)
      iex> {relay.from, relay.kind, relay.body.from, relay.body.hops}
      {:mag2, :relay, :mag1, 1}
  """
  @spec pass_on(t(), atom()) :: {:ok, t()} | :error
  def pass_on(%__MODULE__{hops: hops} = message, me) when hops < @most_hops,
    do: {:ok, new(me, :relay, %{message | hops: hops + 1})}

  def pass_on(_from_afar, _me), do: :error

  @doc """
  Whether a term is a message that a robot may act on. A letter's view that equals `known_view`, which was checked before,
  is not checked again: each letter of a round holds the whole view.

      iex> Swarm.Message.check(%{junk: 1})
      {:error, :not_a_message}
      iex> Swarm.Message.check(Swarm.Message.new(:mag1, :heartbeat, :nonsense))
      {:error, :heartbeat}
  """
  @spec check(term(), known_view :: [atom()]) :: {:ok, t()} | {:error, :not_a_message | kind()}
  def check(term, known_view \\ [])

  def check(%__MODULE__{from: from, kind: kind, body: body} = message, view)
      when kind in [:heartbeat, :round, :claim, :mission, :relay] do
    cond do
      not (Wire.whole?(message, __MODULE__) and Wire.name?(from)) ->
        {:error, :not_a_message}

      message.hops not in 0..@most_hops ->
        {:error, :not_a_message}

      true ->
        case body(kind, body, view) do
          {:ok, body} -> {:ok, %{message | body: body}}
          false -> {:error, kind}
        end
    end
  end

  def check(_term, _view), do: {:error, :not_a_message}

  defp body(:heartbeat, body, _view),
    do: with(:error <- Heartbeat.check(body), do: false)

  defp body(:round, body, view), do: Round.Letter.valid?(body, view) && {:ok, body}

  defp body(:claim, body, _view) do
    with {:ok, %{} = claim} <- Robot.Mission.Claim.check(body),
         do: {:ok, claim},
         else: (_malformed_or_unknown -> false)
  end

  defp body(:mission, body, _view), do: Robot.Mission.Letter.valid?(body) && {:ok, body}

  # Nothing else is passed on, and nothing is wrapped twice.
  defp body(:relay, %__MODULE__{kind: kind, hops: hops} = inner, view)
       when kind in [:heartbeat, :round, :mission] and hops != 0,
       do: with({:error, _reason} <- check(inner, view), do: false)

  defp body(:relay, _other, _view), do: false
end
