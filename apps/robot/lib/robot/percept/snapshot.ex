defmodule Robot.Percept.Snapshot do
  @moduledoc """
  Takes a percept from the board: the newest value of each reading, unless it is stale.

  | reading | stale after |
  |---|---|
  | odometry, sonar, infrared, bumpers, what the gate did | 300 ms |
  | a scan | 500 ms |
  | pan-tilt, detections (by the time of their picture) | 500 ms |
  | battery | 5 s |

  A body with a lidar hears by that: its `sonar` are the beams of the scan, and its `profile` has these for sonars
  (`Hal.Scan.ring/1`). What is written for sonars so serves lidars, too. Sonars that it has besides count for the gate.

  Peers have no limit here: their writer keeps them up to date. The percept has no pose yet:
  `Robot.Localiser` estimates it from this percept.
  """
  alias Hal.Scan
  alias Robot.{Board, Percept}

  @limits [
    odometry: 300,
    ir: 300,
    bumpers: 300,
    driving: 300,
    ptz: 500,
    detections: 500,
    power: 5_000
  ]

  @sonar_ms 300
  # Up to two turns of a lidar that turns five times a second.
  @scan_ms 500

  @typedoc "Looks up a key whose value may be up to so many milliseconds old."
  @type fetch ::
          (key :: atom(), max_age_ms :: pos_integer() ->
             {:ok, term(), at_ms :: integer()} | :error)

  @doc "The percept at this time, from the board."
  @spec take(Board.t(), Hal.Profile.t(), at_ms :: integer()) :: Percept.t()
  def take(%Board{} = board, profile, at_ms) do
    build(
      %Percept{robot: board.robot, at_ms: at_ms, profile: profile, peers: Board.peers(board)},
      &Board.fetch(board, &1, &2, at_ms)
    )
  end

  @doc "Fills an empty percept with the readings that `fetch` returns. Pure if `fetch` is."
  @spec build(Percept.t(), fetch()) :: Percept.t()
  def build(%Percept{profile: body} = percept, fetch) do
    {profile, sonar} = ranges(body, fetch)

    Enum.reduce(@limits, %{percept | profile: profile, sonar: sonar}, fn {key, limit_ms},
                                                                         percept ->
      case fetch.(key, limit_ms) do
        {:ok, value, _at_ms} -> Map.replace!(percept, key, value)
        :error -> percept
      end
    end)
  end

  @doc """
  What a body hears: the body with the poses and the limits of what hears, which are its sonars, or the beams of its lidar;
  and their ranges (metres), `nil` if there are no fresh ones.
  """
  @spec ranges(Hal.Profile.t(), fetch()) :: {Hal.Profile.t(), [float() | nil] | nil}
  def ranges(%{scan: nil} = body, fetch) do
    case fetch.(:sonar, @sonar_ms) do
      {:ok, ranges, _at_ms} -> {body, ranges}
      :error -> {body, nil}
    end
  end

  def ranges(%{scan: lidar} = body, fetch) do
    case fetch.(:scan, @scan_ms) do
      {:ok, scan, _at_ms} -> {Scan.ring(body), Scan.beams(scan, lidar)}
      :error -> {Scan.ring(body), nil}
    end
  end
end
