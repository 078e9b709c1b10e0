defmodule Robot.Localiser.MonteCarlo do
  @moduledoc """
  Finds a robot on a floor plan by its sonars, from nowhere if need be, and says when it is lost (Monte Carlo localisation: Fox,
  Burgard, Dellaert and Thrun 1999; Thrun, Burgard and Fox 2005). Pure.

  Particles are poses where the robot may be, in the frame of the plan. They move by the odometry as the belief does
  (`Robot.Localiser.Belief`), each with a slip of its own. Every few decimetres each is weighed by how well the ranges fit the plan
  from there, and as many are drawn by their weights as the number of places needs (KLD: Fox 2003). Some are drawn anew from where
  the belief is, which knows what cameras see of marks and of other robots; and the less the readings fit of late, the more are
  drawn from all of the plan.

  | state | when |
  |---|---|
  | `:tracking` | there is one place, and what it hears fits the plan |
  | `:ambiguous` | another place fits nearly as well |
  | `:lost` | little of what it hears fits, and other places fit better |

  A lost robot looks for its place among thousands of random ones at each look. A place that fits for some looks is `held`, and the
  search goes on everywhere else, until the robot has driven some metres and nothing else fits nearly as well: rooms look alike.

  A robot that has never heard that the plan is right does not conclude that it is lost: the plan may be of another building. All
  follows from the inputs, the seed and the robot's name; weights are whole numbers, and sums go in the order of the particles.
  """
  alias Hal.Pose
  alias Robot.Localiser.MonteCarlo.{Modes, Population, Readings, Reference}
  alias Nav.Reach
  alias Nav.OccupancyGrid.Cones
  alias Robot.Percept

  # A look is taken after so much way or turn (metres, radians), and this often while a lost robot stands (ms).
  @moved 0.25
  @turned 0.2
  @standing_ms 2_000
  # The sonars of a robot that turns faster than this within a round of them point elsewhere by then (radians).
  @blurred 0.2
  # What is added to the errors of odometry (metres, radians), and for one that searches: what fell near its place gets there.
  @shake {0.02, 0.012}
  @shake_lost {0.06, 0.04}
  # Numbers of particles, and those of one that searches.
  @few {120, 500}
  @many {300, 1_500}
  # So many new ones a look: from the belief; of one that is lost, from all of the plan.
  @believed 12
  @anywhere 6_000
  # Averages of the share that fits, slow and fast, and the greatest share that is drawn from all of the plan by them, at a look with
  # so many echoes: a few may all be those of people.
  @slow 0.02
  @fast 0.3
  @injected 0.05
  @clear 8
  # A look needs so many echoes. The shares of them that fit: of one that is lost; in doubt, compared with other places; good.
  @echoes 6
  @lost 0.4
  @doubtful 0.6
  @good 0.7
  # One is found at a place where so many fit.
  @found_good 0.8
  # The estimate is compared with so many random places; one is better in so many looks.
  @others 200
  @worse 2
  # One whose place is suddenly another one (metres) is lost, if so many echoes say that.
  @jump 1.0
  @surely 8
  # So many more good looks than twice the others show that the plan is right.
  @shown 8
  # A place is held after so many good looks, and another one is a rival after so many, by so much less likelihood a look (1/1024).
  # The robot is found there after so many looks without one, in a large building one for so much floor (m2), and so much way
  # (metres).
  @held 4
  @rival 3
  @nearly 350
  @found 12
  @floor 15.0
  @found_way 3.0

  @enforce_keys [:seed, :at, :last, :at_ms, :state, :held]
  defstruct @enforce_keys ++
              [
                search: nil,
                rivals: [],
                number: 1,
                turned: 0.0,
                way: 0.0,
                fitted: 0.0,
                slow: nil,
                fast: nil,
                worse: 0,
                shown: 0,
                calm: 0
              ]

  @typedoc """
  `held` are the particles of the place where the robot is, as far as it knows, `nil` for none; `search` those of a lost robot
  everywhere else; `rivals` are the other places that fit. `at` is the odometry at the last look, whose `number` it is; `last` is
  the odometry since, `turned` the sum of all angles since (radians), `way` the way since the place is held, or since it did not
  fit (metres), and `fitted` the longest. `shown` counts good looks, `worse` those in a row at which another place fitted better, `calm` those of a lost robot without a
  rival, and those of another one with rivals.
  """
  @type t :: %__MODULE__{
          seed: Reference.draw(),
          at: Pose.t(),
          last: Pose.t(),
          at_ms: integer(),
          state: :tracking | :ambiguous | :lost,
          held: Population.t() | nil,
          search: Population.t() | nil,
          rivals: [Pose.t()],
          number: pos_integer(),
          turned: float(),
          way: float(),
          fitted: float(),
          slow: float() | nil,
          fast: float() | nil,
          worse: non_neg_integer(),
          shown: non_neg_integer(),
          calm: non_neg_integer()
        }

  @typedoc "Where a robot believes to be, in the frame of the plan, and the standard deviations of that (metres, radians)."
  @type hint :: {Pose.t(), {place_sd :: float(), heading_sd :: float()}}

  @doc "The filter of a robot that believes to be there; one that is `lost?` may be elsewhere, too."
  @spec new(Percept.t(), hint(), seed :: integer(), lost? :: boolean()) :: t()
  def new(%Percept{} = percept, {pose, sds}, seed, lost?) do
    draw = Reference.hash(Reference.hash(seed, 0), :erlang.phash2(percept.robot))
    odometry = percept.odometry.pose
    {few, some} = @few
    count = if elem(sds, 0) > @moved, do: some, else: few
    population = Population.near(pose, sds, count, Reference.hash(draw, 0))

    %__MODULE__{
      seed: draw,
      at: odometry,
      last: odometry,
      at_ms: percept.at_ms,
      state: if(lost?, do: :lost, else: :tracking),
      held: if(lost?, do: nil, else: population),
      search: if(lost?, do: population)
    }
  end

  @doc """
  What people and missions are told: `nil` as long as nothing has shown that the plan is right. A robot that was started again on
  its way is `lost?` by its belief until then (`Robot.Localiser`).

      iex> percept = %Robot.Percept{robot: :mag1, profile: Hal.Profile.magellan(), at_ms: 0, odometry: %Hal.Odometry{pose: Hal.Pose.new(0, 0), twist: Hal.Twist.zero()}}
      iex> filter = Robot.Localiser.MonteCarlo.new(percept, {Hal.Pose.new(0, 0), {0.1, 0.1}}, 1, true)
      iex> Robot.Localiser.MonteCarlo.told(filter)
      nil
      iex> filter = %{filter | shown: 10}
      iex> Robot.Localiser.MonteCarlo.told(%{filter | search: %{filter.search | looks: [{3, 12}, {5, 12}, {4, 12}]}})
      {:lost, "lost: a third of what it hears fits the plan"}
      iex> Robot.Localiser.MonteCarlo.told(%{filter | state: :ambiguous, rivals: [Hal.Pose.new(6.2, 3.1)]})
      {:ambiguous, "two places fit: here, or 6.2,3.1"}
  """
  @spec told(t()) :: :tracking | {:ambiguous | :lost, String.t()} | nil
  def told(%__MODULE__{shown: shown}) when shown < @shown, do: nil

  def told(%__MODULE__{state: :lost, held: nil, search: search}),
    do: {:lost, "lost: #{words(Population.share(search))} of what it hears fits the plan"}

  def told(%__MODULE__{state: :lost, held: %{pose: %{x: x, y: y}}}),
    do: {:lost, "lost: perhaps at #{Float.round(x, 1)},#{Float.round(y, 1)}"}

  def told(%__MODULE__{state: :ambiguous, rivals: rivals}) do
    places = for %{x: x, y: y} <- rivals, do: "#{Float.round(x, 1)},#{Float.round(y, 1)}"
    count = if length(rivals) > 1, do: "three", else: "two"
    {:ambiguous, "#{count} places fit: here, or #{Enum.join(places, ", or ")}"}
  end

  def told(%__MODULE__{}), do: :tracking

  defp words(share) do
    Enum.find_value(
      [{0.1, "nothing"}, {0.29, "a quarter"}, {0.42, "a third"}, {0.6, "half"}],
      "most",
      fn {most, words} -> if share == nil or share < most, do: words end
    )
  end

  @doc "Whether it has found that it is not where it was."
  @spec lost?(t()) :: boolean()
  def lost?(%__MODULE__{search: search, shown: shown}), do: search != nil and shown >= @shown

  @doc """
  Where the robot surely is by the plan, and the variance of that; `nil` if it does not surely know. A plan that was not
  `trusted?` must have fitted over a longer way once: two walls of another building may fit for a metre.
  """
  @spec estimate(t(), trusted? :: boolean()) :: {Pose.t(), Modes.variance()} | nil
  def estimate(
        %__MODULE__{state: :tracking, shown: shown, held: %{good: good} = held} = filter,
        trusted?
      )
      when shown >= @shown and good >= @shown and (trusted? or filter.fitted >= @found_way),
      do: {Pose.compose(held.pose, Pose.relative(filter.at, filter.last)), held.variance}

  def estimate(%__MODULE__{}, _trusted?), do: nil

  @doc """
  The filter after a tick. `hint` is where the belief is, by what else it knows, `nil` if that is vague; `among` where the robot
  believes to be among the other robots of the percept.
  """
  @spec update(t(), Percept.t(), hint() | nil, among :: Pose.t()) :: t()
  def update(%__MODULE__{} = filter, %Percept{sonar: nil}, _hint, _among), do: filter

  def update(%__MODULE__{} = filter, %Percept{odometry: %{pose: now}} = percept, hint, among) do
    filter = %{
      filter
      | turned: filter.turned + abs(Pose.wrap(now.heading - filter.last.heading)),
        way: filter.way + Pose.distance(filter.last, now),
        last: now
    }

    stood? = percept.at_ms - filter.at_ms >= @standing_ms
    moved? = Cones.moved?(filter.at, now, @moved, @turned)

    # The same readings again say nothing new of one place; one that searches looks for others.
    if (moved? or (stood? and filter.search != nil)) and not blurred?(percept),
      do: look(filter, percept, {hint, among}),
      else: filter
  end

  @doc """
  For each pose on the plan the logarithm of the likelihood of what the robot's sonars hear, all zeros if that tells nothing: without a
  plan, or while it turns. `among` is as in `update/4`.
  """
  @spec likelihoods(Percept.t(), among :: Pose.t(), [Pose.t()]) :: [float()]
  def likelihoods(%Percept{grid: %{closed?: true} = grid, sonar: ranges} = percept, among, poses)
      when ranges != nil do
    {readings, counting} = Readings.pack(percept, among)

    if blurred?(percept) or counting < @echoes do
      Enum.map(poses, fn _pose -> 0.0 end)
    else
      packed = for p <- poses, into: <<>>, do: Reference.pack({p.x, p.y, p.heading, 0.0})
      look = %{grid: grid, readings: readings}
      for {sum, _fits} <- Population.weigh(packed, look), do: sum / 1024
    end
  end

  def likelihoods(_percept, _among, poses), do: Enum.map(poses, fn _pose -> 0.0 end)

  defp blurred?(%{odometry: odometry, profile: profile}),
    do: abs(odometry.twist.turn) * profile.sonar_round_s > @blurred

  defp look(filter, percept, {hint, among}) do
    {readings, counting} = Readings.pack(percept, among)
    draw = Reference.hash(filter.seed, filter.number)
    look = %{grid: percept.grid, readings: readings, counting: counting, draw: draw}
    filter = moved(filter, percept.at_ms, draw)

    cond do
      counting < @echoes -> filter
      filter.search -> filter |> draw(look, hint) |> search(look, percept)
      true -> filter |> draw(look, hint) |> judge(look, percept) |> decide()
    end
  end

  # Particles and estimate where odometry says that they are by now.
  defp moved(%{at: at, last: last, turned: turned} = filter, at_ms, draw) do
    step = Pose.relative(at, last)
    move = &(&1 && Population.moved(&1, step, turned, &2, Reference.hash(draw, &3)))
    {held, search} = {move.(filter.held, @shake, 1), move.(filter.search, @shake_lost, 2)}
    number = filter.number + 1
    %{filter | held: held, search: search, at: last, at_ms: at_ms, turned: 0.0, number: number}
  end

  defp draw(%{held: nil} = filter, _look, _hint), do: filter

  defp draw(%{held: held} = filter, look, hint) do
    {pose, sds} = hint || {nil, nil}
    believed = if hint, do: Population.about(pose, sds, @believed, Reference.hash(look.draw, 3))
    count = round(injected(filter, look) * byte_size(held.poses) / 32)
    anywhere = Population.anywhere(look.grid, 0.0, count, Reference.hash(look.draw, 4))
    new = (believed || <<>>) <> anywhere

    %{
      filter
      | held: Population.drawn(held, new, %{look | draw: Reference.hash(look.draw, 5)}, @few)
    }
  end

  defp injected(%{fast: fast, slow: slow, search: nil, shown: shown}, %{counting: counting})
       when fast != nil and fast < slow and shown >= @shown and counting >= @clear,
       do: min(1 - fast / slow, @injected)

  defp injected(_content, _look), do: 0.0

  # The verdict on the place that is held, by these readings.
  defp judge(filter, look, percept) do
    held = Population.judged(filter.held, look, @good)
    [{fits, counting} | _] = held.looks
    share = fits / counting

    {better?, good?} = {share < @doubtful and better?(held, look, percept), share >= @good}

    %{
      filter
      | held: held,
        way: if(good?, do: filter.way, else: 0.0),
        fitted: if(good?, do: max(filter.fitted, filter.way), else: filter.fitted),
        slow: mean(filter.slow, share, @slow),
        fast: mean(filter.fast, share, @fast),
        shown: shown(filter.shown, good?),
        worse: if(better?, do: filter.worse + 1, else: 0)
    }
  end

  # A plan of another building fits now and then.
  defp shown(shown, true), do: shown + 1
  defp shown(shown, false), do: if(shown < @shown, do: max(shown - 2, 0), else: shown)

  defp mean(nil, share, _part), do: share
  defp mean(before, share, part), do: before + part * (share - before)

  # Whether one of some random places fits better.
  defp better?(held, look, percept) do
    anywhere(percept, look, @others)
    |> Population.weigh(look)
    |> Enum.any?(fn {sum, _fits} -> sum > held.last end)
  end

  defp anywhere(%{profile: %{radius: radius}}, look, count),
    do: Population.anywhere(look.grid, Reach.room(radius), count, Reference.hash(look.draw, 6))

  defp decide(%{held: held} = filter) do
    cond do
      filter.shown >= @shown and (jumped?(held) or misfit?(filter)) ->
        %{filter | state: :lost, held: nil, search: held, rivals: [], calm: 0}

      held.rivals == [] or filter.shown < @shown ->
        %{filter | state: :tracking, rivals: [], calm: 0}

      # `calm` counts looks with one until it is sure.
      filter.calm + 1 < @rival ->
        %{filter | calm: filter.calm + 1}

      true ->
        %{filter | state: :ambiguous, rivals: held.rivals}
    end
  end

  defp jumped?(%{jump: jump, looks: [{_fits, counting} | _]}),
    do: jump > @jump and counting >= @surely

  defp misfit?(%{held: held, worse: worse}) do
    share = Population.share(held)
    share != nil and share < @lost and worse >= @worse
  end

  defp search(filter, look, percept) do
    except = filter.held && filter.held.pose
    look = %{look | draw: Reference.hash(look.draw, 7)}
    new = anywhere(percept, look, @anywhere)

    search =
      filter.search
      |> Population.drawn(new, look, @many, except)
      |> Population.judged(look, @found_good)

    held = filter.held && Population.judged(filter.held, look, @found_good)
    settle(%{filter | search: search, held: held}, look)
  end

  defp settle(%{held: nil, search: %{good: good}} = filter, look) do
    if good >= @held,
      do: hold(filter, look, filter.search),
      else: %{filter | state: :lost, rivals: []}
  end

  defp settle(%{held: held, search: search} = filter, look) do
    rival? = search.good >= @rival and search.score > held.score - @nearly

    cond do
      (Population.share(held) || 1.0) < @good ->
        settle(%{filter | held: nil}, look)

      rival? and search.score > held.score + @nearly ->
        hold(filter, look, held)

      rival? ->
        %{filter | state: :ambiguous, rivals: [search.pose], calm: 0}

      held.good >= @shown and filter.way >= @found_way and filter.calm >= @found and
          filter.calm >= looks(look.grid) ->
        shown = max(filter.shown, @shown)
        %{filter | state: :tracking, search: nil, shown: shown, slow: nil, fast: nil, calm: 0}

      true ->
        %{filter | state: :lost, rivals: [], calm: filter.calm + 1}
    end
  end

  # The search goes on among `others`.
  defp hold(%{search: search} = filter, look, others) do
    held = Population.alone(search, elem(@few, 0), Reference.hash(look.draw, 8))
    %{filter | held: held, search: others, state: :lost, rivals: [], way: 0.0, calm: 0}
  end

  defp looks(%{clear: clear, cell: cell}) do
    free = for <<units <- clear>>, units > 0, reduce: 0, do: (count -> count + 1)
    max(@found, ceil(free * cell * cell / @floor))
  end
end
