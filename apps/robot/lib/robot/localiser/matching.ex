defmodule Robot.Localiser.Matching do
  @moduledoc """
  Which blob is which robot: data association for things that all look the same. Pure.

  A blob can be a robot where it is seen about there and about as wide as that robot would be. Where a
  blob could well be several robots, or a robot several blobs, nothing is said. A blob that is wider is that of
  several in line, one that is narrower is half hidden: then the robot's direction is less sure (`slack`).
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief}
  alias Robot.Sighting
  alias Vision.Blob

  # Within this angle a robot is always looked for, and never beyond that one, in radians.
  @narrow 0.12
  @wide 0.5
  # A place of which nobody says how well it is known, in metres.
  @unknown 0.3
  # A blob from so much narrower to so much wider than expected may be the robot, as shares.
  @narrowest 0.3
  @widest 2.5
  # How far off, as logarithms of such shares, a blob may be that is measured by, and how much farther off all
  # that it might be else.
  @fits 0.45
  @clear 0.22
  # So little off, it is whole, and its width tells the distance.
  @whole 0.15
  @sighting_sd 0.015

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

    for %{mark: mark, blob: blob} = candidate <- candidates,
        mark.sd != nil and not cut?(blob) and candidate.off < @fits and
          clear?(candidate, candidates),
        do:
          candidate
          |> Map.take([:mark, :blob, :slack])
          |> Map.put(:whole?, candidate.off < @whole)
  end

  defp clear?(%{mark: mark, blob: blob, off: off}, candidates) do
    Enum.all?(candidates, fn other ->
      other.mark == mark == (other.blob == blob) or other.off > off + @clear
    end)
  end

  # At the left or right border; above and below a robot may be cut off.
  defp cut?(blob), do: blob.left == 0 or blob.right == blob.width - 1

  defp candidate(
         %{colour: colour} = mark,
         %Blob{colour: colour} = blob,
         belief,
         exposed,
         pan,
         view
       ) do
    distance = Pose.distance(exposed, mark.at)
    expected = Sighting.width(mark.radius, distance, blob.width, view)
    share = expected && (blob.right - blob.left + 1) / expected

    if share != nil and share > @narrowest and share < @widest do
      slack = abs(share - 1) * :math.asin(mark.radius / distance)
      off = Pose.wrap(Sighting.bearing(blob, pan, view) - Pose.bearing(exposed, mark.at))

      if abs(off) < gate(mark, belief, exposed) + slack,
        do: %{mark: mark, blob: blob, slack: slack, off: abs(:math.log(share))}
    end
  end

  defp candidate(_mark, _blob_of_another_colour, _belief, _exposed, _pan, _view), do: nil

  # Three standard deviations of where it is expected.
  defp gate(%{at: {x, y}, sd: sd}, belief, exposed) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(dx * dx + dy * dy, 0.09)
    own = Belief.variance(belief, {dy / square, -dx / square, -1.0})
    place = (sd || @unknown) * (sd || @unknown) / square
    deviation = :math.sqrt(own + place + @sighting_sd * @sighting_sd)
    (3 * deviation) |> max(@narrow) |> min(@wide)
  end
end
