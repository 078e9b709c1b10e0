defmodule Nav.OccupancyGrid.Cones do
  @moduledoc """
  Turns the readings of a ring of sonars into what the kernels of `Nav.OccupancyGrid` take: for each a cone, in
  cells of 10 cm. Pure.
  """
  alias Hal.Pose
  alias Nav.Grid

  @cell 0.1
  # Ranges (metres): echoes from farther away say too little of where on the arc the wall is. Seen through is what is
  # before an echo, by a margin; less where nothing answered, which may be a wall that throws the echo elsewhere.
  @heard 1.5
  @through 2.5
  @silent 2.0
  @margin 0.15
  # The arc lies behind the surface that sent the echo, and is as deep as lets no cell slip through (cells).
  @behind 0.5
  @thick 0.75
  # Readings are taken this often (ms), and this often while the robot stands (metres, radians): the same
  # reading again says little that is new.
  @every_ms 200
  @standing_ms 1_000
  @moved 0.03
  @turned 0.05
  # Sonars of a robot that turns faster than this within a round of them point elsewhere by then (radians).
  @blurred 0.2
  # An echo this near (metres) to a known body is its echo.
  @explained 0.3
  # A wall of the floor plan that is within this distance (metres), and how unsure the robot is of its place, of a cone up
  # to its echo may have sent it.
  @by_wall 0.1

  @type disc :: {x :: float(), y :: float(), radius :: float()}
  @typedoc "The numbers of the cell in a grid's lower left corner, from that of the frame's origin."
  @type corner :: {integer(), integer()}

  @doc "The width of a cell, metres."
  @spec cell() :: float()
  def cell, do: @cell

  @doc "Half the depth of an arc, in cells."
  @spec thick() :: float()
  def thick, do: @thick

  @doc "Whether the readings of a percept say something new after those of `last_ms`, which were taken at this odometry."
  @spec due?(Nav.percept(), last_ms :: integer() | nil, Pose.t() | nil) :: boolean()
  def due?(%{sonar: nil}, _last_ms, _last), do: false
  def due?(_percept, nil, _last), do: true

  def due?(%{odometry: odometry, profile: profile} = percept, last_ms, last) do
    passed = percept.at_ms - last_ms
    turn = abs(odometry.twist.turn) * (profile.sonar_round_s + 0.1)

    passed >= @every_ms and turn < @blurred and
      (passed >= @standing_ms or moved?(last, odometry.pose, @moved, @turned))
  end

  @doc "Whether a pose differs from another one by more than so many metres or radians."
  @spec moved?(Pose.t(), Pose.t(), way :: float(), turn :: float()) :: boolean()
  def moved?(before, now, way, turn),
    do: Pose.distance(before, now) > way or abs(Pose.wrap(before.heading - now.heading)) > turn

  @doc """
  The cones of a robot at this pose. An echo that one of the `known` bodies explains is no wall, nor is one that a wall of
  the `plan` (map frame) explains; `off` is how far (metres) these may be from where they are supposed to be.
  """
  @spec pack(Nav.percept(), Pose.t(), [disc()], corner(), off :: float(), Grid.t() | nil) ::
          binary()
  def pack(%{profile: profile} = percept, pose, known, corner, off \\ 0.0, plan \\ nil) do
    tangent = :math.tan(profile.sonar_cone / 2)
    near = @explained + off

    for {sonar, range} <- Enum.zip(profile.sonars, percept.sonar),
        is_number(range) and range > profile.sonar_min + 0.005,
        into: <<>> do
      {x, y} = Pose.place(pose, {sonar.x, sonar.y})
      heading = pose.heading + sonar.heading
      {c, s} = {:math.cos(heading), :math.sin(heading)}

      known? =
        Enum.any?(known, &sent?(&1, x, y, c, s, range, tangent, near)) or
          (plan != nil and range <= @heard and
             by_wall?(plan, percept.pose, sonar, range, tangent, off))

      {clear, echo} = reading(range, profile, known?)
      {px, py} = in_cells({x, y}, corner)

      <<px::float-native, py::float-native, c::float-native, s::float-native,
        clear / @cell::float-native, range / @cell + @behind::float-native, echo::float-native>>
    end
  end

  # How far is seen through, and whether there is an echo of something unknown.
  defp reading(range, %{sonar_max: most}, _known?) when range >= most, do: {@silent, 0.0}
  defp reading(range, _profile, true), do: {min(range - @explained, @through), 0.0}

  defp reading(range, _profile, false),
    do: {min(range - @margin, @through), if(range <= @heard, do: 1.0, else: 0.0)}

  @doc """
  Whether an echo is one that neither a wall of the `plan` nor one of the `known` bodies (frame of the odometry) explains, as
  in `pack/6`.
  """
  @spec surprise?(Nav.percept(), [disc()], off :: float(), Grid.t()) :: boolean()
  def surprise?(%{profile: profile} = percept, known, off, plan) do
    tangent = :math.tan(profile.sonar_cone / 2)

    profile.sonars
    |> Enum.zip(percept.sonar)
    |> Enum.any?(fn {sonar, range} ->
      is_number(range) and range > profile.sonar_min + 0.005 and range <= @heard and
        not by_wall?(plan, percept.pose, sonar, range, tangent, off) and
        not by_body?(known, Pose.compose(percept.odometry.pose, sonar), range, tangent, off)
    end)
  end

  defp by_body?(known, %Pose{x: x, y: y, heading: heading}, range, tangent, off) do
    {c, s} = {:math.cos(heading), :math.sin(heading)}
    Enum.any?(known, &sent?(&1, x, y, c, s, range, tangent, @explained + off))
  end

  # Whether the plan has a wall in the cone up to the echo, or beside it.
  defp by_wall?(plan, pose, sonar, range, tangent, off) do
    %Pose{x: x, y: y, heading: heading} = Pose.compose(pose, sonar)
    along = {:math.cos(heading), :math.sin(heading)}
    by_wall?(plan, {x, y}, along, range, tangent, @by_wall + off, 0.0)
  end

  # As far as the walls are away nothing need be looked at.
  defp by_wall?(plan, {x, y} = from, {c, s} = along, range, tangent, beside, way) do
    spare = Grid.clearance(plan, {x + way * c, y + way * s}) - way * tangent - beside

    cond do
      spare < 0.0 ->
        true

      way >= range ->
        false

      true ->
        next = way + max(spare / (1.0 + tangent), plan.cell / 2)
        by_wall?(plan, from, along, range, tangent, beside, min(next, range))
    end
  end

  @doc "Whether an echo of this range (metres), heard by a sonar at this pose with a cone of this width, can come from a disc."
  @spec sent?(disc(), Pose.t(), range :: float(), cone :: float()) :: boolean()
  def sent?(disc, %Pose{x: x, y: y, heading: heading}, range, cone) do
    {c, s} = {:math.cos(heading), :math.sin(heading)}
    sent?(disc, x, y, c, s, range, :math.tan(cone / 2), @explained)
  end

  defp sent?({dx, dy, radius}, x, y, c, s, range, tangent, near) do
    {dx, dy} = {dx - x, dy - y}
    along = dx * c + dy * s
    side = abs(dy * c - dx * s)

    along > -radius and side < max(along, 0.0) * tangent + radius + near and
      abs(:math.sqrt(dx * dx + dy * dy) - radius - range) < near
  end

  @doc "Discs as the kernels take them."
  @spec discs([disc()], corner()) :: binary()
  def discs(discs, corner) do
    for {x, y, radius} <- discs, into: <<>> do
      {px, py} = in_cells({x, y}, corner)
      <<px::float-native, py::float-native, radius / @cell::float-native>>
    end
  end

  @doc "A point in cells from a corner."
  @spec in_cells(Pose.point(), corner()) :: {float(), float()}
  def in_cells({x, y}, {left, low}), do: {x / @cell - left, y / @cell - low}
end
