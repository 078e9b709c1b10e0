defmodule Lab.Trial.AgreementMetrics do
  @moduledoc false
  # Measures from outside how well a fleet agrees, for each part of a partitioned radio: how long a
  # part has two leaders; after a partition heals, when one robot leads all, when the fleet is in
  # formation, and how long robots stood still for that. Pure; fed every 100 ms.
  #
  # A part is a set of robots that can reach each other, if necessary by way of others
  # (`Sim.Radio.parts/2`).

  defstruct rivals_ms: nil, rivals_worst_ms: 0, parts: nil, heals: []

  @typedoc """
  One reduction of the number of parts: when it happened, how many robots led then, the
  milliseconds from then until one led all and until the fleet was in formation, and how long any
  robot stood still, from the first that stopped to the last that went on; `nil` for what has not
  happened yet.
  """
  @type heal :: %{
          at_ms: integer(),
          leaders: non_neg_integer(),
          one_ms: integer() | nil,
          formed_ms: integer() | nil,
          stood_ms: integer() | nil,
          stands_ms: integer() | nil
        }

  @typedoc """
  Some part has had more than one leader since `rivals_ms`; `heals` has the newest first.
  """
  @type t :: %__MODULE__{
          rivals_ms: integer() | nil,
          rivals_worst_ms: non_neg_integer(),
          parts: non_neg_integer() | nil,
          heals: [heal()]
        }

  @doc """
  One tick: the claims of the living robots, each with its `role` (`t:Robot.Mission.role/0`), the leaders of each part
  (`Lab.Trial.RunLog.leaders/2`), and the robots that stand because the mission says so.
  """
  @spec note(t(), integer(), [{atom(), map()}], [{part, leaders}], [atom()]) :: t()
        when part: [atom()], leaders: [atom()]
  def note(agreement, at_ms, claims, led, standing) do
    agreement
    |> rivals(at_ms, led)
    |> heal(at_ms, led)
    |> follow(at_ms, led, claims, standing)
  end

  @doc "For the report: seconds, oldest first."
  @spec report(t()) :: map()
  def report(agreement) do
    %{
      rivals_max_s: agreement.rivals_worst_ms / 1000,
      heals:
        for heal <- Enum.reverse(agreement.heals) do
          %{
            at_s: heal.at_ms / 1000,
            leaders: heal.leaders,
            one_leader_s: seconds(heal.one_ms),
            formed_s: seconds(heal.formed_ms),
            stood_s: seconds(heal.stood_ms)
          }
        end
    }
  end

  defp seconds(nil), do: nil
  defp seconds(ms), do: ms / 1000

  defp rivals(agreement, at_ms, led) do
    if Enum.any?(led, &match?({_part, [_, _ | _]}, &1)) do
      since = agreement.rivals_ms || at_ms
      worst = max(agreement.rivals_worst_ms, at_ms - since + 100)
      %{agreement | rivals_ms: since, rivals_worst_ms: worst}
    else
      %{agreement | rivals_ms: nil}
    end
  end

  defp heal(%{parts: before} = agreement, at_ms, led)
       when before != nil and length(led) < before do
    heal = %{
      at_ms: at_ms,
      leaders: led |> Enum.map(fn {_part, leaders} -> length(leaders) end) |> Enum.sum(),
      one_ms: nil,
      formed_ms: nil,
      stood_ms: nil,
      stands_ms: nil
    }

    %{agreement | parts: length(led), heals: [heal | agreement.heals]}
  end

  defp heal(agreement, _at_ms, led), do: %{agreement | parts: length(led)}

  defp follow(%{heals: []} = agreement, _at_ms, _led, _claims, _standing), do: agreement

  defp follow(%{heals: [heal | older]} = agreement, at_ms, led, claims, standing) do
    one? = match?([_whole], led) and one?(claims)
    formed? = one? and Enum.any?(claims, fn {_id, claim} -> claim[:formed] == true end)
    past = at_ms - heal.at_ms
    heal = if one?, do: %{heal | one_ms: heal.one_ms || past}, else: heal
    heal = if formed?, do: %{heal | formed_ms: heal.formed_ms || past}, else: heal
    %{agreement | heals: [stand(heal, at_ms, standing) | older]}
  end

  # From the first time that a robot stands after the parts were joined until none does.
  defp stand(%{stood_ms: nil, stands_ms: nil} = heal, _at_ms, []), do: heal
  defp stand(%{stood_ms: nil, stands_ms: nil} = heal, at_ms, _), do: %{heal | stands_ms: at_ms}
  defp stand(%{stood_ms: nil} = heal, at_ms, []), do: %{heal | stood_ms: at_ms - heal.stands_ms}
  defp stand(heal, _at_ms, _standing), do: heal

  defp one?(claims) do
    case Enum.uniq(for {_id, claim} <- claims, do: {claim[:leader], claim[:epoch]}) do
      [{leader, _epoch}] when leader != nil ->
        Enum.all?(claims, fn {id, claim} ->
          claim.role == if(id == leader, do: :leads, else: :follows)
        end)

      _several ->
        false
    end
  end
end
