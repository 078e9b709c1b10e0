defmodule Robot.Percept.Snapshot do
  @moduledoc """
  Takes a percept from the board: the newest value of each reading, unless it is stale.

  | reading | stale after |
  |---|---|
  | odometry, sonar, infrared, bumpers, what the gate did | 300 ms |
  | pan-tilt, detections (by the time of their picture) | 500 ms |
  | battery | 5 s |

  Peers have no limit here: their writer keeps them up to date. The percept has no pose yet:
  `Robot.Localiser` estimates it from this percept.
  """
  alias Robot.{Board, Percept}

  @limits [
    odometry: 300,
    sonar: 300,
    ir: 300,
    bumpers: 300,
    driving: 300,
    ptz: 500,
    detections: 500,
    power: 5_000
  ]

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
  def build(%Percept{} = percept, fetch) do
    Enum.reduce(@limits, percept, fn {key, limit_ms}, percept ->
      case fetch.(key, limit_ms) do
        {:ok, value, _at_ms} -> Map.replace!(percept, key, value)
        :error -> percept
      end
    end)
  end
end
