defmodule Sim.Trial.RunLog do
  @moduledoc """
  What is written down of a run as it goes: its stages, its leaders, how long it was in formation.
  Pure; fed every 100 ms with what the living robots claim.
  """

  alias Sim.Trial.{AgreementMetrics, Claims, Stuck}

  defstruct stages: [],
            leader: nil,
            epoch: 0,
            leaders_at_once_max: 0,
            elections: 0,
            searching?: false,
            ticks: 0,
            formed_ticks: 0,
            formed_ms: nil,
            rest_ms: nil,
            accord: %Sim.Trial.AgreementMetrics{},
            claims: %Sim.Trial.Claims{},
            stuck: %Sim.Trial.Stuck{}

  @type stage :: %{
          required(:stage) => atom(),
          required(:at_s) => float(),
          required(:robot) => atom() | nil,
          optional(:epoch) => pos_integer(),
          optional(:size_ppm) => pos_integer()
        }

  @typedoc """
  `stages` has the newest first; `leaders_at_once_max` counts those of one part of the radio; `formed_ms` and `rest_ms` say since when the fleet is in formation, or
  at rest without a landmark, `ticks` and `formed_ticks` count those since the first election.
  """
  @type t :: %__MODULE__{
          stages: [stage()],
          leader: atom() | nil,
          epoch: non_neg_integer(),
          leaders_at_once_max: non_neg_integer(),
          elections: non_neg_integer(),
          searching?: boolean(),
          ticks: non_neg_integer(),
          formed_ticks: non_neg_integer(),
          formed_ms: integer() | nil,
          rest_ms: integer() | nil,
          accord: Sim.Trial.AgreementMetrics.t(),
          claims: Sim.Trial.Claims.t(),
          stuck: Sim.Trial.Stuck.t()
        }

  @doc "An empty ledger."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "Writes a stage; a search that others have begun already is not a new one."
  @spec stage(t(), integer(), atom(), atom() | nil, map()) :: t()
  def stage(%{searching?: true} = ledger, _at_ms, :search, _robot, _facts), do: ledger

  def stage(ledger, at_ms, name, robot, facts) do
    entry = Map.merge(%{stage: name, at_s: at_ms / 1000, robot: robot}, facts)
    entry = if name == :search, do: %{entry | robot: nil}, else: entry
    ledger = %{ledger | stages: [entry | ledger.stages]}

    case name do
      :search -> %{ledger | searching?: true}
      :elected -> %{ledger | elections: ledger.elections + 1}
      _other -> ledger
    end
  end

  @doc """
  One tick of claims, in a radio that is divided into these parts (`nil` for one that is whole), and who
  stands still.
  """
  @spec note(t(), integer(), [{atom(), map()}], [[atom()]] | nil, [atom()]) :: t()
  def note(ledger, at_ms, claims, parts \\ nil, standing \\ []) do
    parts = parts || [for({id, _claim} <- claims, do: id)]
    leaders = for {id, %{phase: :lead} = claim} <- claims, do: {id, claim}
    phases = for {_id, claim} <- claims, do: claim[:phase]
    formed? = Enum.any?(leaders, fn {_id, claim} -> claim[:formed] == true end)
    elected? = ledger.elections > 0

    %{
      ledger
      | leader: highest(leaders),
        epoch:
          Enum.reduce(claims, ledger.epoch, fn {_id, claim}, e -> max(e, claim[:epoch] || 0) end),
        leaders_at_once_max: max(ledger.leaders_at_once_max, at_once(leaders, parts)),
        accord: AgreementMetrics.note(ledger.accord, at_ms, claims, parts, standing),
        searching?: :search in phases,
        ticks: ledger.ticks + if(elected?, do: 1, else: 0),
        formed_ticks: ledger.formed_ticks + if(elected? and formed?, do: 1, else: 0),
        formed_ms: if(formed?, do: ledger.formed_ms || at_ms),
        rest_ms:
          if(phases != [] and Enum.all?(phases, &(&1 == :rest)), do: ledger.rest_ms || at_ms)
    }
  end

  @doc """
  The same tick judged by true poses (`Sim.Trial.Claims`): `worst` says of a leader how far the worst robot
  of its shape is from its slot, in metres.
  """
  @spec judge(t(), integer(), [{atom(), map()}], (atom() -> float() | nil)) :: t()
  def judge(ledger, at_ms, claims, worst) do
    leaders = for {id, %{phase: :lead, formed: true}} <- claims, do: id
    %{ledger | claims: Claims.note(ledger.claims, at_ms, leaders, worst)}
  end

  @doc "The same tick of the invariant of `Sim.Trial.Stuck`; `rows` is asked once a second."
  @spec watch(t(), integer(), (... -> [Stuck.row()])) :: t()
  def watch(ledger, at_ms, rows), do: %{ledger | stuck: Stuck.note(ledger.stuck, at_ms, rows)}

  @doc "Who leads now: of several the one of the highest epoch."
  @spec leader(t()) :: atom() | nil
  def leader(ledger), do: ledger.leader

  @doc "Whether the fleet is in formation now, by its own judgement."
  @spec formed?(t()) :: boolean()
  def formed?(ledger), do: ledger.formed_ms != nil

  @doc "Since when the fleet has been in formation, or at rest without a landmark; `nil` if it is not."
  @spec calm_since_ms(t()) :: integer() | nil
  def calm_since_ms(ledger), do: ledger.formed_ms || ledger.rest_ms

  @doc "The stages, oldest first."
  @spec stages(t()) :: [stage()]
  def stages(ledger), do: Enum.reverse(ledger.stages)

  @doc "The share of the time since the first election that the fleet was in formation."
  @spec share_formed(t()) :: float()
  def share_formed(%{ticks: 0}), do: 0.0
  def share_formed(ledger), do: ledger.formed_ticks / ledger.ticks

  # In one part: parts that cannot reach each other each have their own.
  defp at_once(leaders, parts) do
    parts
    |> Enum.map(fn part -> Enum.count(leaders, fn {id, _claim} -> id in part end) end)
    |> Enum.max(fn -> 0 end)
  end

  defp highest([]), do: nil

  defp highest(leaders) do
    {id, _claim} = Enum.max_by(leaders, fn {id, claim} -> {claim[:epoch] || 0, id} end)
    id
  end
end
