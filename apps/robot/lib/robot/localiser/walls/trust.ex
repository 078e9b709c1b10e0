defmodule Robot.Localiser.Walls.Trust do
  @moduledoc false
  # Decides whether a floor plan is that of the building in which the robot is, at the place where it believes to be, by how well
  # its readings agree with the plan. Pure.
  #
  # Each reading is evidence: the logarithm of how much likelier it is if the plan is right than if it has nothing to do with
  # it. What counts is the sum over the last readings as a share of what it would be if each of them agreed exactly, so that a
  # robot that is unsure of its place, and can expect almost any range, decides nothing. A plan is trusted until readings
  # contradict it; then it takes more of them to trust it again.

  # A reading that has nothing to do with the plan may have any range (per metre), and so may this share of all others: of
  # people, of furniture, of echoes by two walls.
  @any 0.2
  @stray 0.2
  # So much possible evidence is remembered, and is enough to trust a plan again: 25 and 10 readings of a robot that knows where
  # it is.
  @memory 60.0
  @enough 20.0
  # The shares: it is trusted again, is no longer, is surely right; and a round of readings is fair enough to be used.
  @again 0.8
  @least 0.5
  @surely 0.85
  @fair 0.5

  defstruct got: @enough, could: @enough, trusted?: true

  @typedoc "The evidence that the last readings gave, and that they `could` have given."
  @type t :: %__MODULE__{got: float(), could: float(), trusted?: boolean()}
  @typedoc "`:right` for a round that agrees with a plan that has long been right; `:unfair` for one that alone disagrees."
  @type verdict :: :right | :fair | :unfair | :wrong

  @doc """
  The evidence of a reading whose innovation is `error` (metres) where its variance is expected to be `s`.

      iex> for error <- [0.0, 1.0], do: error |> Robot.Localiser.Walls.Trust.evidence(0.04) |> Float.round(1)
      [2.1, -1.6]
  """
  @spec evidence(error :: float(), s :: float()) :: float()
  def evidence(error, s) do
    likely = :math.exp(-error * error / (2 * s)) / :math.sqrt(2 * :math.pi() * s)
    :math.log((1 - @stray) * likely / @any + @stray)
  end

  @doc "Of a robot to which readings must show again that it is where it believes to be."
  @spec none() :: t()
  def none, do: %__MODULE__{got: 0.0, could: 0.0, trusted?: false}

  @doc "Weighs a round of readings by the evidence that it gave, and that it could have given."
  @spec weigh(t(), got :: float(), could :: float()) :: {verdict(), t()}
  def weigh(trust, got, could) do
    kept = max(1.0 - could / @memory, 0.0)
    trust = %{trust | got: kept * trust.got + got, could: kept * trust.could + could}
    trusted? = trusted?(trust)
    {verdict(trusted?, trust, got, could), %{trust | trusted?: trusted?}}
  end

  defp trusted?(%{trusted?: true} = trust), do: trust.got >= @least * trust.could

  defp trusted?(trust), do: trust.could >= @enough and trust.got >= @again * trust.could

  defp verdict(false, _trust, _got, _could), do: :wrong

  defp verdict(true, trust, got, could) do
    cond do
      got < @fair * could -> :unfair
      got >= @surely * could and trust.got >= @surely * trust.could -> :right
      true -> :fair
    end
  end
end
