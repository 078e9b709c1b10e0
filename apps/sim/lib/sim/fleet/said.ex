defmodule Sim.Fleet.Said do
  @moduledoc """
  Holds back announcements of a live fleet (one leads, its fleet is formed) until the robots'
  claims show them. Pure.

  A robot tells a stage by an event, and claims the same on its board, which the fleet looks at ten times a second. Told
  at once, the stage would be on the screen while the run log still says the opposite. So it waits for the claim. One that no claim
  shows within 5 looks, 0.5 s, was withdrawn at once, and is told all the same: it was said.
  """

  @looks 5

  @typedoc "What was said, the oldest first, and in how many looks at claims it has not been shown."
  @type t :: [{looks :: non_neg_integer(), stage()}]
  @type stage :: {name :: atom(), robot :: atom(), facts :: map()}

  @doc "Whether a stage is one that waits for the robot's claim."
  @spec waits?(stage :: atom()) :: boolean()
  def waits?(stage), do: stage in [:elected, :formed]

  @doc "Takes in what a robot said."
  @spec hear(t(), stage()) :: t()
  def hear(said, stage), do: said ++ [{0, stage}]

  @doc """
  One look at the claims: what can be told now, and what still waits.

      iex> formed = {:formed, :mag1, %{epoch: 2}}
      iex> said = Sim.Fleet.Said.hear([], formed)
      iex> {[], said} = Sim.Fleet.Said.look(said, mag1: %{phase: :lead})
      iex> Sim.Fleet.Said.look(said, mag1: %{phase: :lead, formed: true})
      {[{:formed, :mag1, %{epoch: 2}}], []}
  """
  @spec look(t(), [{robot :: atom(), claim :: map()}]) :: {[stage()], t()}
  def look(said, claims) do
    {told, left} = Enum.split_with(said, &(shown?(&1, claims) or late?(&1)))
    left = for {looks, stage} <- left, do: {looks + 1, stage}
    {Enum.map(told, &elem(&1, 1)), left}
  end

  defp shown?({_looks, {:elected, robot, _facts}}, claims),
    do: match?({_id, %{phase: :lead}}, List.keyfind(claims, robot, 0))

  defp shown?({_looks, {:formed, robot, _facts}}, claims),
    do: match?({_id, %{phase: :lead, formed: true}}, List.keyfind(claims, robot, 0))

  defp late?({looks, _stage}), do: looks >= @looks - 1
end
