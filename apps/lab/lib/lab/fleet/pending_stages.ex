defmodule Lab.Fleet.PendingStages do
  @moduledoc false
  # Holds back announcements of a live fleet (one leads, its fleet is formed) until the robots'
  # claims show them. Pure.
  #
  # A robot reports a stage by an event, and claims the same on its board, which the fleet reads ten
  # times a second. If the stage were announced at once, it would be on the screen while the run log
  # still says the opposite. So it waits for the claim. If no claim shows it within 5 readings (0.5
  # s), it was withdrawn at once, and is announced all the same, because it was reported.

  @looks 5

  @typedoc """
  The reported stages, the oldest first, each with the number of readings in which no claim has
  shown it.
  """
  @type t :: [{looks :: non_neg_integer(), stage()}]
  @type stage :: {name :: atom(), robot :: atom(), facts :: map()}

  @typedoc "What the mission's phases and stages are (`Robot.Mission.roles/1`)."
  @type roles :: %{atom() => Robot.Mission.role()}

  @doc "Whether a stage has to wait for the robot's claim."
  @spec waits?(stage :: atom(), roles()) :: boolean()
  def waits?(stage, roles), do: stage == :formed or roles[stage] == :elects

  @doc "Adds a stage that a robot reported."
  @spec hear(t(), stage()) :: t()
  def hear(said, stage), do: said ++ [{0, stage}]

  @doc """
  One reading of the claims: returns what can be announced now, and what still waits.

      iex> formed = {:formed, :mag1, %{epoch: 2}}
      iex> said = Lab.Fleet.PendingStages.hear([], formed)
      iex> {[], said} = Lab.Fleet.PendingStages.look(said, [mag1: %{phase: :lead}], %{lead: :leads})
      iex> Lab.Fleet.PendingStages.look(said, [mag1: %{phase: :lead, formed: true}], %{lead: :leads})
      {[{:formed, :mag1, %{epoch: 2}}], []}
  """
  @spec look(t(), [{robot :: atom(), claim :: map()}], roles()) :: {[stage()], t()}
  def look(said, claims, roles) do
    {told, left} = Enum.split_with(said, &(shown?(&1, claims, roles) or late?(&1)))
    left = for {looks, stage} <- left, do: {looks + 1, stage}
    {Enum.map(told, &elem(&1, 1)), left}
  end

  defp shown?({_looks, {stage, robot, _facts}}, claims, roles) do
    claim = Keyword.get(claims, robot, %{})
    roles[claim[:phase]] == :leads and (stage != :formed or claim[:formed] == true)
  end

  defp late?({looks, _stage}), do: looks >= @looks - 1
end
