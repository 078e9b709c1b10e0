defmodule Robot.Localiser.MonteCarlo.Population do
  @moduledoc false
  # Keeps particles of one search: how they move, are weighed and drawn, and how well what the robot hears fits the place where most
  # of them are. Pure.
  alias Hal.Pose
  alias Robot.Localiser.MonteCarlo.{Modes, Native, Readings, Reference, Sampling}
  alias Nav.Grid

  # What a look adds to the errors of the belief's model of odometry (`Robot.Localiser.Belief`) is `shake`; that model:
  @way_variance 1.0e-5
  @turn_variance 2.5e-4
  @slip_sd 0.055
  @slip_change 0.005
  # How many particles a call of a kernel takes.
  @chunk 500
  # The verdict is on so many looks, and a mean of the likelihood is over about so many.
  @looks 3
  @mean 0.15
  # A place that is farther off than by odometry is another one (metres).
  @jump 0.3
  # Other places count from this share of the particles of the first one on.
  @rival 0.2
  # What is so near to a place is it (metres, radians).
  @here 1.0
  @turned 0.6

  @enforce_keys [:poses, :pose, :variance]
  defstruct @enforce_keys ++
              [rivals: [], looks: [], good: 0, count: 0, score: 0.0, last: 0, jump: 0.0]

  @typedoc """
  `pose` and `variance` are those of the place with the most particles, `rivals` the other places that fit. `looks` are the numbers
  of readings that fitted there and that counted, the newest first, `good` counts the good ones in a row and `count` all; `score` is
  the mean of the logarithm of the likelihood of all readings (1/1024), `last` that of the last look. At that it was `jump` metres from where it was before.
  """
  @type t :: %__MODULE__{
          poses: binary(),
          pose: Pose.t(),
          variance: Modes.variance(),
          rivals: [Pose.t()],
          looks: [{fitted :: non_neg_integer(), counted :: pos_integer()}],
          good: non_neg_integer(),
          count: non_neg_integer(),
          score: float(),
          last: integer(),
          jump: float()
        }

  @typedoc "What a look is taken with: the plan, the packed readings and how many of them count, and bits for random numbers."
  @type look :: %{
          grid: Grid.t(),
          readings: binary(),
          counting: pos_integer(),
          draw: Reference.draw()
        }

  @doc "Particles about a pose, with these standard deviations of place and heading (metres, radians)."
  @spec near(Pose.t(), {float(), float()}, pos_integer(), Reference.draw()) :: t()
  def near(%Pose{} = pose, {place_sd, heading_sd}, count, draw) do
    variance = {place_sd * place_sd, 0.0, place_sd * place_sd, heading_sd * heading_sd}

    %__MODULE__{
      poses: about(pose, {place_sd, heading_sd}, count, draw),
      pose: pose,
      variance: variance
    }
  end

  @doc "The particles of `near/4` as the kernels take them."
  @spec about(Pose.t(), {float(), float()}, pos_integer(), Reference.draw()) :: binary()
  def about(pose, {place_sd, heading_sd}, count, draw) do
    particle = Reference.pack({pose.x, pose.y, pose.heading, 0.0})
    step = floats([0.0, 0.0, 0.0, 0.0, place_sd, heading_sd, @slip_sd])
    kernel().move(:binary.copy(particle, count), step, draw)
  end

  @doc "Particles anywhere on the plan where a robot needs so much room (metres)."
  @spec anywhere(Grid.t(), room :: float(), non_neg_integer(), Reference.draw()) :: binary()
  def anywhere(grid, room, count, draw) do
    for first <- 0..(count - 1)//@chunk, into: <<>> do
      some = min(count - first, @chunk)
      kernel().scatter(some, map(grid), Grid.needed(room), @slip_sd, Reference.hash(draw, first))
    end
  end

  @doc """
  The particles after a step of odometry in which the angles turned sum up to `turned`; `shake` are the standard deviations of
  place and heading that are added, so that no two stay the same.
  """
  @spec moved(t(), Pose.t(), turned :: float(), shake :: {float(), float()}, Reference.draw()) ::
          t()
  def moved(population, step, turned, {place, heading}, draw) do
    way = :math.sqrt(step.x * step.x + step.y * step.y)
    place_sd = :math.sqrt(@way_variance * way + place * place)
    heading_sd = :math.sqrt(@turn_variance * turned + @way_variance * way + heading * heading)
    slip_sd = @slip_change * :math.sqrt(turned)
    packed = floats([step.x, step.y, step.heading, turned, place_sd, heading_sd, slip_sd])

    poses =
      for {chunk, k} <- Enum.with_index(chunks(population.poses)),
          into: <<>>,
          do: kernel().move(chunk, packed, Reference.hash(draw, k))

    %{population | poses: poses, pose: Pose.compose(population.pose, step)}
  end

  defp floats(numbers), do: for(number <- numbers, into: <<>>, do: <<number::float-native>>)

  @doc """
  Weighs the particles and some new ones, and draws as many by their weights as their places need, within these bounds. Those
  about the pose `except` are left out.
  """
  @spec drawn(
          t(),
          new :: binary(),
          look(),
          {pos_integer(), pos_integer()},
          except :: Pose.t() | nil
        ) ::
          t()
  def drawn(population, new, look, {least, most}, except \\ nil) do
    poses = population.poses <> new

    weighed =
      for {{x, y, heading, _slip} = pose, {sum, _fits}} <-
            Enum.zip(Reference.unpack(poses), weigh(poses, look)),
          except == nil or not here?(except, Pose.new(x, y, heading)),
          do: {pose, sum}

    if weighed == [],
      do: %{population | good: 0, count: 0},
      else: draw(population, Enum.unzip(weighed), look.draw, {least, most})
  end

  defp draw(population, {poses, sums}, draw, {least, most}) do
    weights = Sampling.weights(sums)
    before = population.poses |> byte_size() |> div(32) |> max(least)
    once = Sampling.draw(poses, weights, before, Reference.hash(draw, -1))
    count = once |> Sampling.enough() |> max(least) |> min(most)
    [best | others] = Modes.find(once)

    drawn =
      for {pose, copies} <- Sampling.draw(poses, weights, count, Reference.hash(draw, -2)),
          packed = Reference.pack(pose),
          _copy <- 1..copies,
          into: <<>>,
          do: packed

    jump = Pose.distance(best.pose, Pose.point(population.pose))
    jumped? = jump > @jump

    %{
      population
      | poses: drawn,
        pose: best.pose,
        variance: best.variance,
        jump: jump,
        rivals:
          for(%{share: share, pose: pose} <- others, share >= @rival * best.share, do: pose),
        good: if(jumped?, do: 0, else: population.good),
        count: if(jumped?, do: 0, else: population.count)
    }
  end

  @doc "The particles of its place alone, as many."
  @spec alone(t(), pos_integer(), Reference.draw()) :: t()
  def alone(%{pose: pose, variance: {xx, _xy, yy, heading}} = population, count, draw) do
    sds = {:math.sqrt(max(xx, yy)), :math.sqrt(heading)}
    %{population | poses: about(pose, sds, count, draw), rivals: []}
  end

  @doc "Whether a pose is the same place as another one."
  @spec here?(Pose.t(), Pose.t()) :: boolean()
  def here?(a, b) do
    Pose.distance(a, Pose.point(b)) <= @here and
      abs(Pose.wrap(a.heading - b.heading)) <= @turned
  end

  @doc """
  Notes how well the readings fit the place of the particles; a look is good from this share on, of its own readings or of those of
  the last looks.
  """
  @spec judged(t(), look(), good :: float()) :: t()
  def judged(%{pose: pose} = population, look, good) do
    [{sum, fits}] = weigh(Reference.pack({pose.x, pose.y, pose.heading, 0.0}), look)
    looks = Enum.take([{fits, look.counting} | population.looks], @looks)
    good? = fits >= good * look.counting or (share(%{looks: looks}) || 0.0) >= good
    mean = max(@mean, 1 / (population.count + 1))

    %{
      population
      | looks: looks,
        good: if(good?, do: population.good + 1, else: 0),
        count: population.count + 1,
        score: population.score + mean * (sum - population.score),
        last: sum
    }
  end

  @doc "The share of the last readings that fit; `nil` as long as there were too few looks."
  @spec share(t()) :: float() | nil
  def share(%{looks: looks}) when length(looks) < @looks, do: nil

  def share(%{looks: looks}) do
    {fits, counting} = Enum.unzip(looks)
    Enum.sum(fits) / Enum.sum(counting)
  end

  @doc "For each particle the logarithm of the likelihood (1/1024), and how many readings fit."
  @spec weigh(binary(), look()) :: [{integer(), non_neg_integer()}]
  def weigh(poses, look) do
    for chunk <- chunks(poses),
        weighed = kernel().weigh(chunk, map(look.grid), look.readings, Readings.tables()),
        <<sum::32-signed-native, fits::32-signed-native <- weighed>>,
        do: {sum, fits}
  end

  defp chunks(poses) when byte_size(poses) <= @chunk * 32, do: [poses]

  defp chunks(poses) do
    <<chunk::binary-size(@chunk * 32), rest::binary>> = poses
    [chunk | chunks(rest)]
  end

  defp map(%Grid{} = grid),
    do: {grid.clear, grid.width, grid.height, grid.cell, grid.left, grid.low}

  defp kernel, do: if(Native.loaded?(), do: Native, else: Reference)
end
