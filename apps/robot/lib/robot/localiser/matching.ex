defmodule Robot.Localiser.Matching do
  @moduledoc """
  Data association: decides which blob is which robot, though all look the same. Pure.

  A blob can be a robot where it is seen about there and about as wide as that robot would be. Where a
  blob could well be several robots, or a robot several blobs, nothing is said. A blob that is wider is that of
  several in line, one that is narrower is half hidden: then the robot's direction is less sure (`slack`).
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}
  alias Robot.Percept.Sighting
  alias Vision.Blob

  # Within this angle (radians) a robot is always looked for; one whose distance is less sure than by this share
  # is not measured by.
  @narrow 0.12
  @doubt 1.6
  # A doubt of a distance that changes nothing, in metres.
  @surely 0.3
  # Standard deviations of a direction (radians), and of a width, as a logarithm: others beside it make a blob wider,
  # others before it narrower.
  @bearing_sd 0.04
  @wider_sd 0.2
  @narrower_sd 0.5
  # So many standard deviations, squared, off it is not the robot, or so much worse than another.
  @unlike 9.0
  @worse 4.0
  # A blob that is measured by is not farther off in width than this, as a logarithm; and if within that one, it is whole.
  @fits 0.45
  @whole 0.15
  # What stands so far behind another, in metres, is hidden by it.
  @behind 0.5

  @type pair :: %{
          mark: Anchors.mark(),
          blob: Blob.t(),
          slack: float(),
          whole?: boolean()
        }

  @doc "The robots among the marks that are seen for sure, each with its blob, in the order of the marks."
  @spec pairs([Anchors.mark()], [Blob.t()], Belief.t(), Pose.t(), pan :: float(), view :: float()) ::
          [pair()]
  def pairs(robots, blobs, belief, exposed, pan, view) do
    candidates =
      for mark <- robots,
          blob <- blobs,
          c = candidate(mark, blob, belief, exposed, pan, view),
          do: c

    for %{mark: mark, blob: blob} = one <- candidates,
        mark.reference? and one.sure? and not cut?(blob) and one.width < @fits,
        Enum.all?(candidates, &(&1.cost > one.cost + @worse or not rivals?(one, &1))) do
      %{mark: mark, blob: blob, slack: one.slack, whole?: one.width < @whole}
    end
  end

  # The same robot another blob, or the same blob another robot, which this one does not hide.
  defp rivals?(%{mark: mark, blob: blob}, %{mark: mark, blob: other}), do: blob != other
  defp rivals?(%{blob: blob} = one, %{blob: blob} = other), do: not hides?(one, other)
  defp rivals?(_one, _other), do: false

  defp hides?(near, far) do
    far.distance > near.distance + @behind and
      abs(Pose.wrap(far.expected - near.expected)) < near.half
  end

  # At the left or right border; above and below a robot may be cut off.
  defp cut?(blob), do: blob.left == 0 or blob.right == blob.width - 1

  defp candidate(%{colour: colour} = mark, %{colour: colour} = blob, belief, exposed, pan, view) do
    distance = Pose.distance(exposed, mark.at)
    width = Sighting.width(mark.radius, distance, blob.width, view)

    if width != nil do
      share = (blob.right - blob.left + 1) / width
      half = :math.asin(mark.radius / distance)
      expected = Pose.bearing(exposed, mark.at)
      seen = Sighting.bearing(blob, pan, view)
      {bearing_sd, distance_sd} = sds(mark, distance, belief, exposed)
      # What nobody knows of the distance makes the blob wider or narrower.
      doubt = 2 * max(distance_sd - @surely, 0.0) / distance
      slack = abs(share - 1) * half
      off = max(abs(Pose.wrap(seen - expected)) - slack, 0.0)
      cost = cost(off, bearing_sd, :math.log(share), doubt)

      if off < max(3 * bearing_sd, @narrow) and cost < @unlike do
        %{
          mark: mark,
          blob: blob,
          distance: distance,
          expected: expected,
          half: half,
          slack: slack,
          width: abs(:math.log(share)),
          cost: cost,
          sure?: doubt < @doubt
        }
      end
    end
  end

  defp candidate(_mark, _blob_of_another_colour, _belief, _exposed, _pan, _view), do: nil

  # Squares of standard deviations in direction and width.
  defp cost(off, bearing_sd, width, doubt) do
    sd = if width > 0, do: @wider_sd, else: @narrower_sd
    width = max(abs(width) - doubt, 0.0) / sd
    bearing = off / max(bearing_sd, @bearing_sd)
    bearing * bearing + width * width
  end

  # How far off, in direction and distance, it may be seen.
  defp sds(%{at: {x, y}} = mark, distance, belief, exposed) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(distance * distance, 0.09)
    length = max(distance, 0.01)
    {x, y} = {dx / length, dy / length}
    across = Belief.variance(belief, {dy / square, -dx / square, -1.0}, mark)
    along = Belief.variance(belief, {-x, -y, 0.0}, mark)
    bearing = across + @bearing_sd * @bearing_sd / 4

    # However unsure it is of its place, a thing in front of it is not seen behind it.
    {:math.atan(root(bearing)), root(along)}
  end

  # Rounding takes a variance of nothing below it.
  defp root(square), do: :math.sqrt(max(square, 0.0))
end
