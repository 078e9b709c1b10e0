defmodule Robot.Localiser.Matching do
  @moduledoc """
  Decides which blob is which robot, although all robots look the same (data association). Pure.

  A blob can be a robot if its direction and its width are about those expected of the robot. If a
  blob could well be several robots, or a robot several blobs, neither is paired. A wider blob may
  show several robots, and a narrower one a robot that is partly hidden: then the robot's
  direction is less certain (`slack`).
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Glance, InSight}
  alias Robot.Percept.Sighting
  alias Vision.Blob

  # A blob within this angle (radians) of the expected direction is always a candidate. A robot
  # whose distance is less certain than this share is not used for measurements.
  @narrow 0.12
  @doubt 1.6
  # An uncertainty of a distance up to this (metres) does not count.
  @surely 0.3
  # Standard deviations of a direction (radians) and of the logarithm of a width: robots beside
  # the robot make its blob wider, those in front of it narrower.
  @bearing_sd 0.04
  @wider_sd 0.2
  @narrower_sd 0.5
  # A candidate with a greater cost (in squares of standard deviations) is rejected, and a rival
  # does not count if its cost is greater by this much.
  @unlike 9.0
  @worse 4.0
  # The greatest difference in width, as a logarithm, of a blob that is used for measurements, and
  # of a blob that counts as the whole robot.
  @fits 0.45
  @whole 0.15
  # A robot can hide another one that is at least this much farther away, in metres.
  @behind 0.5

  @type pair :: %{
          mark: Anchors.mark(),
          blob: Blob.t(),
          bearing: float(),
          slack: float(),
          whole?: boolean()
        }

  @doc """
  The reference robots among the marks that match a blob without a rival, each with its blob, in
  the order of the marks. None is a robot that walls hide (`in_sight`). `named` are the marks on robots that were read in the
  picture: a blob with the mark of a robot is that one, and no other.
  """
  @spec pairs(
          [Anchors.mark()],
          [Blob.t()],
          Belief.t(),
          Pose.t(),
          pan :: float(),
          view :: float(),
          InSight.t(),
          named :: %{atom() => Vision.Mark.t()}
        ) :: [pair()]
  def pairs(robots, blobs, belief, exposed, pan, view, in_sight, named \\ %{}) do
    owners = owners(blobs, named)
    colours = Enum.uniq(for mark <- robots, do: mark.colour)

    looks =
      for(
        %{colour: colour} = blob <- blobs,
        colour in colours,
        do: {colour, blob, Sighting.bearing(blob, pan, view)}
      )
      |> Enum.group_by(&elem(&1, 0))

    glance = Glance.new(belief, exposed, pan, view)
    widest = Enum.reduce(blobs, 0.0, &max((&1.right - &1.left + 1) / &1.width, &2))
    broad = widest * :math.tan(view / 2)

    candidates =
      for mark <- robots,
          near?(mark, glance, broad),
          [{_colour, %{width: picture}, _seen} | _] = alike <- [Map.get(looks, mark.colour)],
          expected = expected(mark, belief, exposed, {picture, view}),
          beside = expected |> beside(alike) |> own(mark.key, owners),
          beside != [] and InSight.seen?(in_sight, mark),
          c <- candidates(expected, beside, belief, exposed),
          do: c

    for %{mark: mark, blob: blob} = one <- candidates,
        mark.reference? and one.sure? and not cut?(blob) and one.width < @fits,
        Enum.all?(candidates, &(&1.cost > one.cost + @worse or not rivals?(one, &1))) do
      %{mark: mark, blob: blob, bearing: one.seen, slack: one.slack, whole?: one.width < @whole}
    end
  end

  # Which robot a blob is that shows the mark of just one.
  defp owners(_blobs, named) when named == %{}, do: %{}

  defp owners(blobs, named) do
    for blob <- blobs,
        [id] <- [for({id, mark} <- named, shows?(blob, mark), do: id)],
        into: %{},
        do: {blob, {:robot, id}}
  end

  defp shows?(blob, %{x: x, y: y}),
    do: x >= blob.left and x <= blob.right and y >= blob.top and y <= blob.bottom

  defp own(beside, _key, owners) when owners == %{}, do: beside

  defp own(beside, key, owners) do
    case Enum.filter(beside, fn {blob, _, _, _, _} -> owners[blob] == key end) do
      [] -> Enum.filter(beside, fn {blob, _, _, _, _} -> not is_map_key(owners, blob) end)
      known -> known
    end
  end

  # The same robot with another blob, or the same blob with another robot that this one does not
  # hide.
  defp rivals?(%{mark: mark, blob: blob}, %{mark: mark, blob: other}), do: blob != other
  defp rivals?(%{blob: blob} = one, %{blob: blob} = other), do: not hides?(one, other)
  defp rivals?(_one, _other), do: false

  defp hides?(near, far) do
    far.distance > near.distance + @behind and
      abs(Pose.wrap(far.expected - near.expected)) < near.half
  end

  # Whether a blob touches the left or right border; it may be cut off above and below.
  defp cut?(blob), do: blob.left == 0 or blob.right == blob.width - 1

  # Whether it can be a blob. However wide a blob is, its slack is no more than half of that width, or of the robot's.
  defp near?(%{at: at, radius: radius} = mark, glance, broad) do
    aside = Glance.aside(glance, at)

    aside < @narrow or
      (
        distance = Pose.distance(glance.pose, at)
        half = if distance > radius, do: :math.asin(radius / distance), else: :math.pi()
        slack = if half > broad, do: half, else: broad
        off = aside - slack
        off < @narrow or off < 3 * (Glance.most_sd(glance, mark, distance) + @bearing_sd)
      )
  end

  # How a robot should look from there, for all blobs; `nil` for one that cannot be seen from within.
  defp expected(mark, belief, exposed, {picture, view}) do
    distance = Pose.distance(exposed, mark.at)

    if distance > mark.radius do
      %{
        mark: mark,
        distance: distance,
        width: Sighting.width(mark.radius, distance, picture, view),
        half: :math.asin(mark.radius / distance),
        bearing: Pose.bearing(exposed, mark.at),
        bearing_sd: bearing_sd(mark, distance, belief, exposed)
      }
    end
  end

  # The blobs in whose direction a robot may be, each with the share of its width and how far it is off.
  defp beside(expected, looks) do
    %{width: width, half: half, bearing: bearing, bearing_sd: bearing_sd} = expected

    for {_colour, blob, seen} <- looks,
        share = (blob.right - blob.left + 1) / width,
        slack = abs(share - 1) * half,
        off = max(abs(Pose.wrap(seen - bearing)) - slack, 0.0),
        off < @narrow or off < 3 * bearing_sd,
        do: {blob, seen, share, slack, off}
  end

  # How certain its distance is, is asked only of a robot that is beside a blob.
  defp candidates(_expected, [], _belief, _exposed), do: []

  defp candidates(%{mark: mark, distance: distance} = expected, beside, belief, exposed) do
    # If the distance is uncertain, so is the expected width of the blob.
    doubt = 2 * max(distance_sd(mark, distance, belief, exposed) - @surely, 0.0) / distance

    for {blob, seen, share, slack, off} <- beside,
        log = :math.log(share),
        cost = cost(off, expected.bearing_sd, log, doubt),
        cost < @unlike do
      %{
        mark: mark,
        blob: blob,
        seen: seen,
        distance: distance,
        expected: expected.bearing,
        half: expected.half,
        slack: slack,
        width: abs(log),
        cost: cost,
        sure?: doubt < @doubt
      }
    end
  end

  # The sum of the squared deviations in direction and width, each in standard deviations.
  defp cost(off, bearing_sd, width, doubt) do
    sd = if width > 0, do: @wider_sd, else: @narrower_sd
    width = max(abs(width) - doubt, 0.0) / sd
    bearing = off / max(bearing_sd, @bearing_sd)
    bearing * bearing + width * width
  end

  # The standard deviation of the direction in which the robot is seen. However uncertain the place is, it stays within
  # half a turn.
  defp bearing_sd(%{at: {x, y}} = mark, distance, belief, exposed) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(distance * distance, 0.09)
    across = Belief.variance(belief, {dy / square, -dx / square, -1.0}, mark)
    :math.atan(root(across + @bearing_sd * @bearing_sd / 4))
  end

  # The same of its distance.
  defp distance_sd(%{at: {x, y}} = mark, distance, belief, exposed) do
    length = max(distance, 0.01)
    {x, y} = {(x - exposed.x) / length, (y - exposed.y) / length}
    root(Belief.variance(belief, {-x, -y, 0.0}, mark))
  end

  # Rounding may make a variance of zero negative.
  defp root(square), do: :math.sqrt(max(square, 0.0))
end
