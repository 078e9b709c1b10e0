defmodule Robot.Localiser.MonteCarlo.Modes do
  @moduledoc false
  # Finds the places where particles are: one, or several that fit. Pure.
  alias Hal.Pose

  # Particles within these of the middle of a mode belong to it (metres, radians).
  @near 0.75
  @aside 0.5
  # A mode begins at the fullest of such bins.
  @bin 0.5
  @turn :math.pi() / 6
  # Modes of a lesser share do not count, and no more than so many.
  @least 0.05
  @most 3

  @typedoc "That of x, the covariance, that of y (m2), that of the heading (rad2)."
  @type variance :: {xx :: float(), xy :: float(), yy :: float(), heading :: float()}
  @typedoc "`share` is that of all particles."
  @type t :: %{
          share: float(),
          pose: Pose.t(),
          slip: float(),
          variance: variance()
        }

  @doc """
  The modes of poses that were drawn so often, the heaviest first.

      iex> poses = for x <- [1.0, 1.1, 4.0], do: {{x, 2.0, 3.1, 0.0}, 5}
      iex> for mode <- Robot.Localiser.MonteCarlo.Modes.find(poses), do: {Float.round(mode.share, 2), Float.round(mode.pose.x, 2)}
      [{0.67, 1.05}, {0.33, 4.0}]
  """
  @spec find([{{float(), float(), float(), float()}, pos_integer()}]) :: [t()]
  def find(drawn) do
    all = count(drawn)
    drawn |> find(all, 0) |> Enum.sort_by(&{-&1.share, &1.pose.x, &1.pose.y})
  end

  defp find(drawn, _all, found) when drawn == [] or found == @most, do: []

  defp find(drawn, all, found) do
    {near, far} = part(drawn, middle(drawn))
    {near, far} = if far == [], do: {near, far}, else: part(drawn, begun(drawn))
    # The mean of a few that lie apart may be none of them.
    {near, far} = if near == [], do: {drawn, []}, else: {near, far}
    share = count(near) / all

    if near != [] and (found == 0 or share >= @least),
      do: [mode(near, share) | find(far, all, found + 1)],
      else: []
  end

  defp begun(drawn) do
    begun = middle(fullest(drawn))
    drawn |> Enum.filter(&near?(&1, begun)) |> middle()
  end

  defp part(drawn, middle), do: Enum.split_with(drawn, &near?(&1, middle))
  defp count(drawn), do: drawn |> Enum.map(&elem(&1, 1)) |> Enum.sum()

  defp fullest(drawn) do
    {_bin, poses} =
      drawn
      |> Enum.group_by(fn {{x, y, heading, _slip}, _copies} ->
        {floor(x / @bin), floor(y / @bin), floor(heading / @turn)}
      end)
      |> Enum.max_by(fn {bin, poses} -> {count(poses), bin} end)

    poses
  end

  # Angles are taken from that of the first pose, which all of a mode are near.
  defp middle([{{_x, _y, first, _slip}, _copies} | _] = drawn) do
    {n, x, y, turn, slip} =
      Enum.reduce(drawn, {0, 0.0, 0.0, 0.0, 0.0}, fn {{px, py, heading, share}, w},
                                                     {n, x, y, turn, slip} ->
        {n + w, x + w * px, y + w * py, turn + w * Pose.wrap(heading - first), slip + w * share}
      end)

    {Pose.new(x / n, y / n, first + turn / n), slip / n}
  end

  defp near?({{x, y, heading, _slip}, _copies}, {middle, _}) do
    {dx, dy} = {x - middle.x, y - middle.y}

    dx * dx + dy * dy <= @near * @near and
      abs(Pose.wrap(heading - middle.heading)) <= @aside
  end

  defp mode(drawn, share) do
    {middle, slip} = middle(drawn)

    {n, xx, xy, yy, hh} =
      Enum.reduce(drawn, {0, 0.0, 0.0, 0.0, 0.0}, fn {{x, y, heading, _slip}, w},
                                                     {n, xx, xy, yy, hh} ->
        {dx, dy, dh} = {x - middle.x, y - middle.y, Pose.wrap(heading - middle.heading)}
        {n + w, xx + w * dx * dx, xy + w * dx * dy, yy + w * dy * dy, hh + w * dh * dh}
      end)

    %{share: share, pose: middle, slip: slip, variance: {xx / n, xy / n, yy / n, hh / n}}
  end
end
