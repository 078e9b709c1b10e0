defmodule Lab.Check.Expectation do
  @moduledoc """
  Describes what a scenario may expect of its run, as data. Pure; `Lab.Check` judges it. Seconds
  count from the start of the run, all that is measured is true, as nobody in the run knows it.

  | expectation | holds if |
  |---|---|
  | `{:formed, by_s: s}` | the fleet is in formation by then, by its own judgement |
  | `{:formed_again, after_s: s, within_s: s}` | the formation ends after that time and is there again so much later, or never ended |
  | `{:not_formed}` | it is never in formation |
  | `{:leader, by_s: s}` | somebody leads by then |
  | `{:leader_changed, after_s: s, within_s: s}` | so much later another robot leads than at that time |
  | `{:same_leader, from_s: s}` | the leader of that time goes on leading |
  | `{:one_leader, after_s: s}` | from then on, exactly one robot leads in each part of the radio's network |
  | `{:at_most_one_leader, grace_s: s}` | no part of the network has two leaders for longer than that |
  | `{:agreed, by_s: s}` | all living robots name one leader and one epoch by then |
  | `{:rest, by_s: s}` | all living robots rest by then, because there is no landmark |
  | `{:phase, who, phase, by_s: s}` | that robot's mission, or all, is in this phase by then |
  | `{:never_phase, who, phase}` | that robot, or any, is never in this phase |
  | `{:says, who, word, by_s: s}` | that follower, or all but the leader, claims to be `:in_place`, `:unsure` of its place or `:blocked` |
  | `{:at, robot, {x, y}, within_m: m, by_s: s}` | it stands or drives there by then |
  | `{:in_slot, who, within_m: m, by_s: s}` | it is, or all are at once, that near to the place that the leader means |
  | `{:still, who, from_s: s, to_s: s}` | it does, or all do, not move in that time |
  | `{:moves, who, by_s: s}` | it drives, or each has driven, faster than 5 cm/s by then |
  | `{:turned, robot, degrees, within_deg: d, by_s: s}` | it has turned so far on the spot by then, left is positive |
  | `{:sees_distance, robot, within_percent: p}` | its measure of the distance to the landmark is never further off, and it has one |
  | `{:speed_at_most, m_s}` | no robot is ever faster |
  | `{:separation_at_least, m}` | no two robots come closer, edge to edge |
  | `{:never, invariant}` | this invariant is never violated (`Lab.Check.Invariants`), judged as in `mix chaos` |

  `who` is a robot or `:all`. Those with `by_s` also take `after_s` (0): what was before does not
  count. Those about the whole run take `from_s` (0) and `to_s` (its end).
  """
  alias Hal.Options.Type
  alias Lab.Check.{Bodies, Fleet, Invariants}
  alias Lab.Trial.Form

  @type t :: tuple()

  # The phases of a command for one robot alone (`Robot.Mission.Manual`).
  @alone [
    :move,
    :goto,
    :follow,
    :follow_the_leader,
    :find_blob,
    :run,
    :done,
    :given_up,
    :found,
    :not_found
  ]

  @doc "The type of a list of expectations, in a table of `Hal.Options`."
  @spec list_type() :: Type.t()
  def list_type,
    do: {:list, {:check, &read/1, "an expectation, such as {:formed, by_s: 60}"}, 1000}

  @doc """
  An expectation with its numbers as floats, or what is wrong with it.

      iex> Lab.Check.Expectation.read({:still, :mag1, from_s: 3, to_s: 9})
      {:ok, {:still, :mag1, [from_s: 3.0, to_s: 9.0]}}
      iex> Lab.Check.Expectation.read({:still, :mag1, from_s: 3})
      {:error, [{["to_s"], "is missing: expected a number from 0 to 1000000 s"}]}
      iex> Lab.Check.Expectation.read({:phase, :all, :leed, by_s: 9}) |> elem(1) |> hd() |> elem(1) |> String.split("; ") |> List.last()
      "did you mean :lead?"
  """
  @spec read(term()) :: Type.result()
  def read(term) do
    forms = for {_kind, form} <- table(), do: form
    with {:ok, expectation} <- Form.read(term, forms, "an expectation"), do: ordered(expectation)
  end

  # A window that ends before it begins would hold always, or never.
  defp ordered(expectation) do
    {from_s, to_s} = window(expectation)

    if to_s > from_s,
      do: {:ok, expectation},
      else: {:error, [{[], "expected an end after the beginning, got #{inspect(expectation)}"}]}
  end

  # All expectations, as forms of `Lab.Trial.Form`, with the module that judges them (`Lab.Check.Kind`).
  defp table do
    robot = {:check, &(is_atom(&1) and &1 not in [nil, true, false, :all]), "a robot of this run"}

    who =
      {:check, &(is_atom(&1) and &1 not in [nil, true, false]), "a robot of this run, or :all,"}

    metres = {:number, -1.0e4, 1.0e4, "m"}
    place = {:tuple, [metres, metres], "{x, y} in metres"}
    phase = {:one_of, phases()}
    by = [by_s: required(seconds()), after_s: seconds()]
    within = [after_s: required(seconds()), within_s: required({:number, 0.1, 1_000_000, "s"})]
    always = [from_s: seconds(), to_s: seconds()]
    size = required({:number, 0, 1000, "m"})
    span = [from_s: required(seconds()), to_s: required(seconds())]
    degrees = {:number, 0, 36_000, "degrees"}

    [
      {Fleet, {:formed, [], by}},
      {Fleet, {:formed_again, [], within}},
      {Fleet, {:not_formed, [], always}},
      {Fleet, {:leader, [], by}},
      {Fleet, {:leader_changed, [], within}},
      {Fleet, {:same_leader, [], [from_s: required(seconds()), to_s: seconds()]}},
      {Fleet, {:one_leader, [], [after_s: required(seconds()), to_s: seconds()]}},
      {Fleet, {:at_most_one_leader, [], [grace_s: required(seconds())]}},
      {Fleet, {:agreed, [], by}},
      {Fleet, {:rest, [], by}},
      {Fleet, {:phase, [robot: who, phase: phase], by}},
      {Fleet, {:never_phase, [robot: who, phase: phase], always}},
      {Fleet, {:says, [robot: who, word: {:one_of, [:in_place, :unsure, :blocked]}], by}},
      {Bodies, {:at, [robot: robot, place: place], [{:within_m, size} | by]}},
      {Bodies, {:in_slot, [robot: who], [{:within_m, size} | by]}},
      {Bodies, {:still, [robot: who], span}},
      {Bodies, {:moves, [robot: who], by}},
      {Bodies,
       {:turned, [robot: robot, degrees: {:number, -36_000, 36_000, "degrees"}],
        [{:within_deg, required(degrees)} | by]}},
      {Bodies,
       {:sees_distance, [robot: robot],
        [{:within_percent, required({:number, 0, 1000, "percent"})} | always]}},
      {Bodies, {:speed_at_most, [m_s: {:number, 0, 100, "m/s"}], always}},
      {Bodies, {:separation_at_least, [metres: {:number, 0, 1000, "m"}], []}},
      {Invariants, {:never, [invariant: {:one_of, Invariants.names()}], []}}
    ]
  end

  defp seconds, do: {:number, 0, 1_000_000, "s"}
  defp required(type), do: [type, required: true]

  @doc "The module that judges an expectation (`Lab.Check.Kind`), and what it is asked: with options, also if none are given."
  @spec asked(t()) :: {module(), t()}
  def asked({:never, invariant} = never), do: {Invariants.kind(invariant), never}

  def asked(expectation) do
    {kind, {_name, values, keys}} = row(expectation)
    whole? = keys == [] or tuple_size(expectation) > length(values) + 1

    {kind,
     if(whole?, do: expectation, else: Tuple.insert_at(expectation, tuple_size(expectation), []))}
  end

  defp row(expectation),
    do: Enum.find(table(), fn {_kind, form} -> elem(form, 0) == elem(expectation, 0) end)

  @doc "The phases that a robot may be in, with any mission that has a name (`c:Robot.Mission.phases/0`)."
  @spec phases() :: [atom()]
  def phases, do: Enum.uniq(Swarm.MissionRegistry.phases() ++ @alone)

  @doc """
  The options of an expectation.

      iex> Lab.Check.Expectation.options({:formed, [by_s: 60.0]})
      [by_s: 60.0]
      iex> Lab.Check.Expectation.options({:never, :collision})
      []
  """
  @spec options(t()) :: keyword()
  def options(expectation) do
    case elem(expectation, tuple_size(expectation) - 1) do
      options when is_list(options) -> options
      _value -> []
    end
  end

  @doc "The robots that it names."
  @spec robots(t()) :: [atom()]
  def robots(expectation) do
    {_kind, {_name, types, _keys}} = row(expectation)
    for {{:robot, _type}, n} <- Enum.with_index(types, 1), do: elem(expectation, n)
  end

  @doc """
  The seconds between which it is judged; the second is `:end` for the end of the run.

      iex> Lab.Check.Expectation.window({:formed_again, [after_s: 40.0, within_s: 30.0]})
      {40.0, 70.0}
      iex> Lab.Check.Expectation.window({:never, :collision})
      {0, :end}
  """
  @spec window(t()) :: {from_s :: number(), to_s :: number() | :end}
  def window(expectation) do
    options = options(expectation)
    from_s = options[:after_s] || options[:from_s] || 0
    within_s = options[:within_s]
    {from_s, options[:by_s] || options[:to_s] || (within_s && from_s + within_s) || :end}
  end

  @doc "How long the run must be able to last, in seconds, for it to be judged."
  @spec until_s(t()) :: number()
  def until_s(expectation) do
    case window(expectation) do
      {from_s, :end} -> from_s
      {_from_s, to_s} -> to_s
    end
  end
end
