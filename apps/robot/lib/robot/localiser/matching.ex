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
  @wide 1.2
  # A place of which nobody says how well it is known, in metres.
  @unknown 0.3
  # So many times wider or narrower than expected a blob may be the robot, as a logarithm.
  @widest 0.92
  # How far off, as logarithms of such shares, a blob may be that is measured by, and how much farther off all
  # that it might be else.
  @fits 0.45
  # A robot whose distance is less sure than this, as a share, may be seen but not measured by.
  @doubt 0.4
  @lost 0.3
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
        mark.sd != nil and candidate.sure? and not cut?(blob) and candidate.off < @fits and
          clear?(candidate, candidates),
        do:
          candidate
          |> Map.take([:mark, :blob, :slack])
          |> Map.put(:whole?, candidate.share < @whole)
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

    if share != nil do
      {bearing_sd, distance_sd} = sds(mark, distance, belief, exposed)
      slack = abs(share - 1) * :math.asin(mark.radius / distance)
      bearing = Pose.wrap(Sighting.bearing(blob, pan, view) - Pose.bearing(exposed, mark.at))
      # As a share of the distance, what nobody knows of it makes the blob wider or narrower.
      doubt = 2 * max(distance_sd - @lost, 0.0) / distance
      off = max(abs(:math.log(share)) - doubt, 0.0)

      if off < @widest and abs(bearing) < max(3 * bearing_sd, @narrow) + slack do
        %{
          mark: mark,
          blob: blob,
          slack: slack,
          off: off,
          share: abs(:math.log(share)),
          sure?: 3 * bearing_sd < @wide and doubt < @doubt
        }
      end
    end
  end

  defp candidate(_mark, _blob_of_another_colour, _belief, _exposed, _pan, _view), do: nil

  # How far off, in direction and distance, it may be seen.
  defp sds(%{at: {x, y}, sd: sd}, distance, belief, exposed) do
    {dx, dy} = {x - exposed.x, y - exposed.y}
    square = max(distance * distance, 0.09)
    place = (sd || @unknown) * (sd || @unknown)
    across = Belief.variance(belief, {dy / square, -dx / square, -1.0})
    along = Belief.variance(belief, {-dx / distance, -dy / distance, 0.0})

    {:math.sqrt(across + place / square + @sighting_sd * @sighting_sd), :math.sqrt(along + place)}
  end
end
