defmodule Lab.Trial.RunLog do
  @moduledoc false
  # Records a run: its stages, its leaders, how long it was in formation. Pure; fed every 100 ms
  # with what the living robots claim.

  alias Sim.Scene
  alias Lab.Trial.{AgreementMetrics, Claims, Progress}

  defstruct mission: nil,
            roles: %{},
            most: nil,
            stages: [],
            leader: nil,
            epoch: 0,
            leaders_at_once_max: 0,
            elections: 0,
            searching?: false,
            ticks: 0,
            formed_ticks: 0,
            formed_ms: nil,
            rest_ms: nil,
            estop: nil,
            agreement: %Lab.Trial.AgreementMetrics{},
            claims: %Lab.Trial.Claims{},
            stuck: %Lab.Trial.Progress{}

  @type stage :: %{
          required(:stage) => atom(),
          required(:at_s) => float(),
          required(:robot) => atom() | nil,
          optional(:epoch) => pos_integer(),
          optional(:size_ppm) => pos_integer()
        }

  @typedoc """
  `roles` are those of the phases and stages (`c:Robot.Mission.roles/0`); `most` is how many stages, claims, silences and
  heals are kept (`nil`: all), and then stages have numbers; `stages` has the newest first; `leaders_at_once_max` counts leaders in the same part of the
  radio; `formed_ms` and `rest_ms` say since when the fleet has been in formation, or at rest
  without a landmark; `ticks` and `formed_ticks` count from the first election.
  """
  @type t :: %__MODULE__{
          mission: module() | nil,
          roles: %{atom() => Robot.Mission.role()},
          most: pos_integer() | nil,
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
          estop: Scene.estop() | nil,
          agreement: Lab.Trial.AgreementMetrics.t(),
          claims: Lab.Trial.Claims.t(),
          stuck: Lab.Trial.Progress.t()
        }

  @doc "An empty run log of a mission; of a run without an end with how much of it is kept."
  @spec new(module(), most :: pos_integer() | nil) :: t()
  def new(mission, most \\ nil),
    do: %__MODULE__{mission: mission, roles: Robot.Mission.roles(mission), most: most}

  @doc "Records a stage; a search that others have already begun is not a new one."
  @spec stage(t(), integer(), atom(), atom() | nil, map()) :: t()
  def stage(run_log, at_ms, name, robot, facts) do
    entry = Map.merge(%{stage: name, at_s: at_ms / 1000, robot: robot}, facts)

    case run_log.roles[name] do
      :searches when run_log.searching? ->
        run_log

      :searches ->
        %{add(run_log, %{entry | robot: nil}) | searching?: true}

      :elects ->
        %{add(run_log, entry) | elections: run_log.elections + 1}

      _other ->
        add(run_log, entry)
    end
  end

  defp add(%{most: nil} = run_log, entry), do: %{run_log | stages: [entry | run_log.stages]}

  defp add(%{stages: stages} = run_log, entry) do
    n = if stages == [], do: 1, else: hd(stages).n + 1
    %{run_log | stages: newest(run_log, [Map.put(entry, :n, n) | stages])}
  end

  defp newest(%{most: nil}, all), do: all
  defp newest(%{most: most}, all), do: Enum.take(all, most)

  @doc """
  One tick of what robots claim that are not frozen, the parts that the radio is divided into (`nil` if it is whole), and which
  robots stand still.
  """
  @spec note(t(), integer(), [{atom(), map()}], [[atom()]] | nil, [atom()]) :: t()
  def note(run_log, at_ms, claims, parts \\ nil, standing \\ []) do
    parts = parts || [for({id, _claim} <- claims, do: id)]
    claims = for {id, claim} <- claims, do: {id, Map.put(claim, :role, role(run_log, claim))}
    led = leaders(claims, parts)
    leaders = for {id, %{role: :leads} = claim} <- claims, do: {id, claim}
    # A mission without a leader has what it wants when every robot says so.
    formed? =
      Enum.any?(leaders, fn {_id, claim} -> claim[:formed] == true end) or
        (claims != [] and Enum.all?(claims, fn {_id, claim} -> claim[:formed] == true end))

    elected? = run_log.elections > 0

    %{
      run_log
      | leader: highest(leaders),
        epoch:
          Enum.reduce(claims, run_log.epoch, fn {_id, claim}, e -> max(e, claim[:epoch] || 0) end),
        leaders_at_once_max: max(run_log.leaders_at_once_max, at_once(led)),
        agreement: AgreementMetrics.note(run_log.agreement, at_ms, claims, led, standing),
        searching?: Enum.any?(claims, &match?({_id, %{role: :searches}}, &1)),
        ticks: run_log.ticks + if(elected?, do: 1, else: 0),
        formed_ticks: run_log.formed_ticks + if(elected? and formed?, do: 1, else: 0),
        formed_ms: if(formed?, do: run_log.formed_ms || at_ms),
        rest_ms:
          if(claims != [] and Enum.all?(claims, &match?({_id, %{role: :rests}}, &1)),
            do: run_log.rest_ms || at_ms
          )
    }
  end

  @doc "The same tick: which robots an emergency stop holds, frozen ones among them."
  @spec held(t(), integer(), [{atom(), map()}]) :: t()
  def held(run_log, at_ms, claims) do
    held = for {id, %{estop: callers}} <- claims, do: {id, callers}
    estop = Scene.estop(run_log.estop, held, length(claims), at_ms)
    log = %{run_log | estop: estop}

    case {run_log.estop, estop} do
      {nil, %{by: by}} -> stage(log, at_ms, :estop_holds, nil, %{by: by})
      {%{}, nil} -> stage(log, at_ms, :estop_over, nil, %{})
      _the_same -> log
    end
  end

  @doc """
  The same tick judged by true poses (`Lab.Trial.Claims`): `worst` returns for a leader how far
  the worst robot of its shape is from its slot, in metres.
  """
  @spec judge(t(), integer(), [{atom(), map()}], (atom() -> float() | nil)) :: t()
  def judge(run_log, at_ms, claims, worst) do
    leaders = for {id, %{formed: true} = c} <- claims, role(run_log, c) == :leads, do: id
    claims = Claims.note(run_log.claims, at_ms, leaders, worst)
    %{run_log | claims: %{claims | told: newest(run_log, claims.told)}}
  end

  @doc "The same tick for the invariant of `Lab.Trial.Progress`; `rows` is called once a second."
  @spec watch(t(), integer(), (... -> [Progress.row()])) :: t()
  def watch(run_log, at_ms, rows) do
    stuck = Progress.note(run_log.stuck, at_ms, rows)
    %{run_log | stuck: %{stuck | told: newest(run_log, stuck.told)}}
  end

  @doc "What a robot that claims this does for its group (`c:Robot.Mission.roles/0`); `nil` for nothing."
  @spec role(t(), claim :: map()) :: Robot.Mission.role() | nil
  def role(run_log, claim), do: run_log.roles[claim[:phase]]

  @doc """
  The leaders of each part of the radio, by claims that each have their `role`: all that speaks of two leaders at once asks
  this. Parts that cannot reach each other each have their own leader.

      iex> claims = [mag1: %{role: :leads}, mag2: %{role: :leads}, mag3: %{role: :follows}]
      iex> Lab.Trial.RunLog.leaders(claims, [[:mag1, :mag3], [:mag2]])
      [{[:mag1, :mag3], [:mag1]}, {[:mag2], [:mag2]}]
  """
  @spec leaders([{atom(), map()}], parts) :: [{part :: [atom()], leaders :: [atom()]}]
        when parts: [[atom()]]
  def leaders(claims, parts) do
    leaders = for {id, %{role: :leads}} <- claims, do: id
    for part <- parts, do: {part, Enum.filter(part, &(&1 in leaders))}
  end

  @doc "What such a claim says (`c:Robot.Mission.account/1`)."
  @spec account(t(), claim :: map()) :: Robot.Mission.account()
  def account(run_log, claim), do: Robot.Mission.account(run_log.mission, claim)

  @doc "The leader now; among several, the one of the highest epoch."
  @spec leader(t()) :: atom() | nil
  def leader(run_log), do: run_log.leader

  @doc "Whether the fleet is in formation now, by its own judgement."
  @spec formed?(t()) :: boolean()
  def formed?(run_log), do: run_log.formed_ms != nil

  @doc "Since when the fleet has been in formation, or at rest without a landmark; `nil` if it is not."
  @spec calm_since_ms(t()) :: integer() | nil
  def calm_since_ms(run_log), do: run_log.formed_ms || run_log.rest_ms

  @doc "The stages, oldest first."
  @spec stages(t()) :: [stage()]
  def stages(run_log), do: Enum.reverse(run_log.stages)

  @doc "The share of the time since the first election that the fleet was in formation."
  @spec share_formed(t()) :: float()
  def share_formed(%{ticks: 0}), do: 0.0
  def share_formed(run_log), do: run_log.formed_ticks / run_log.ticks

  defp at_once(led),
    do: led |> Enum.map(fn {_part, leaders} -> length(leaders) end) |> Enum.max(fn -> 0 end)

  defp highest([]), do: nil

  defp highest(leaders) do
    {id, _claim} = Enum.max_by(leaders, fn {id, claim} -> {claim[:epoch] || 0, id} end)
    id
  end
end
