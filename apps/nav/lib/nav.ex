defmodule Nav do
  @moduledoc """
  Walls, and ways between them. Pure; knows bodies and units (`Hal`), but no robot, fleet or process.

  | subject | module |
  |---|---|
  | a floor plan from a file, as map_server writes it | `Nav.MapFile` |
  | walls as clearances of cells, and ways over them | `Nav.Grid`, `Nav.PathPlanner`, `Nav.Reach` |
  | what a robot's sonars have seen | `Nav.OccupancyGrid` (of late), `Nav.Survey` (since it began) |
  | plan and sonars together | `Nav.KnownWalls` |
  | where the known meets the unknown | `Nav.Frontiers` |
  | speeds that avoid bodies; a body's wheels | `Nav.Orca`, `Nav.Steering`, `Nav.PassingPlace` |

  A corridor of nine cells of 10 cm with a wall in the middle of it:

      iex> grid = Nav.Grid.new(<<0, 0, 0, 0, 1, 0, 0, 0, 0>>, {9, 1}, 0.1, {0.0, 0.0}, closed?: false)
      iex> for x <- [0.25, 0.75], do: Nav.Grid.free_line?(grid, {0.05, 0.05}, {x, 0.05}, 0.1)
      [true, false]
  """
  alias Hal.{Odometry, Pose, Profile}

  @typedoc """
  What is read of a robot's percept, a struct or a map with these keys: its `pose` in the map frame and the `uncertainty` of
  that, its `odometry`, ranges of its `sonar` in the order of its `profile`, and the bodies of its `peers`.
  """
  @type percept :: %{
          required(:at_ms) => integer(),
          required(:profile) => Profile.t(),
          required(:pose) => Pose.t() | nil,
          required(:odometry) => Odometry.t() | nil,
          required(:sonar) => [float()] | nil,
          required(:uncertainty) => %{optional(atom()) => term()} | nil,
          required(:peers) => %{
            atom() => %{
              required(:pose) => Pose.t(),
              required(:radius) => float(),
              optional(atom()) => term()
            }
          },
          optional(atom()) => term()
        }
end
