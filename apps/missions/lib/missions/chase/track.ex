defmodule Missions.Chase.Track do
  @moduledoc """
  Tracks one ball by the sightings of several robots. Pure; metres in the map frame, milliseconds.

  A Kalman filter with a constant velocity and white noise of acceleration (Bar-Shalom, Li and Kirubarajan, Estimation with Applications
  to Tracking and Navigation, 2001, section 6.2.2), alike along x and y, so that one covariance does for both: after `t` seconds

      pp' = pp + 2 t pv + t^2 vv + q t^3 / 3
      pv' = pv + t vv + q t^2 / 2
      vv' = vv + q t

  A sighting counts if it is within the gate, of 99 %. Five in a row outside of it are the ball elsewhere, where the track begins
  anew. `q` is less for a ball that lies. The ball is found after three sightings within a second, and lost after 3 s without one.
  """
  alias Hal.Pose

  # (m/s2)2 s: of a ball that is pushed and stops within seconds, and of one that is slower than so many m/s.
  @noise 0.15
  @lying 0.01
  @slow 0.08
  @gate 9.21
  @elsewhere 5
  @found 3
  @found_ms 1_000
  @lost_ms 3_000
  # So long it goes on as it did; then it is taken to lie.
  @ahead_ms 1_000
  @start_speed_var 0.1

  @enforce_keys [:at, :var, :at_ms, :seen_ms, :first_ms]
  defstruct @enforce_keys ++
              [
                velocity: {0.0, 0.0},
                pv: 0.0,
                vv: @start_speed_var,
                seen: 1,
                found?: false,
                outside: 0
              ]

  @typedoc "`var` is the variance of the place along each axis (m2), `seen_ms` when a sighting last counted."
  @type t :: %__MODULE__{
          at: Pose.point(),
          velocity: {float(), float()},
          var: float(),
          pv: float(),
          vv: float(),
          at_ms: integer(),
          seen_ms: integer(),
          first_ms: integer(),
          seen: pos_integer(),
          found?: boolean(),
          outside: non_neg_integer()
        }

  @doc """
  The track after a sighting of the ball at a place with this variance (m2), taken at `at_ms`.

      iex> track = Missions.Chase.Track.note(nil, {1.0, 2.0}, 0.01, 0)
      iex> track = Enum.reduce(1..20, track, &Missions.Chase.Track.note(&2, {1.0 + 0.02 * &1, 2.0}, 0.01, 100 * &1))
      iex> {x, y} = track.velocity
      iex> {Float.round(x, 1), y, track.found?, track.var < 0.01}
      {0.2, 0.0, true, true}
  """
  @spec note(t() | nil, Pose.point(), float(), integer()) :: t()
  def note(nil, place, var, at_ms), do: new(place, var, at_ms)

  # After a second without a sighting nothing is known of its velocity any more.
  def note(%__MODULE__{seen_ms: seen_ms, found?: found?}, place, var, at_ms)
      when at_ms - seen_ms > @ahead_ms,
      do: %{new(place, var, at_ms) | found?: found? and at_ms - seen_ms <= @lost_ms}

  def note(track, {x, y} = place, var, at_ms) do
    track = predict(track, at_ms)
    # One that was heard late is where it would be by now.
    late_s = (track.at_ms - at_ms) / 1000
    {vx, vy} = track.velocity
    {dx, dy} = {x + vx * late_s - elem(track.at, 0), y + vy * late_s - elem(track.at, 1)}
    spread = track.var + var + track.vv * late_s * late_s

    cond do
      (dx * dx + dy * dy) / spread <= @gate -> correct(track, {dx, dy}, spread, at_ms)
      track.outside + 1 >= @elsewhere -> new(place, var, at_ms)
      true -> %{track | outside: track.outside + 1}
    end
  end

  defp new(place, var, at_ms),
    do: %__MODULE__{at: place, var: var, at_ms: at_ms, seen_ms: at_ms, first_ms: at_ms}

  defp correct(track, {dx, dy}, spread, at_ms) do
    {x, y} = track.at
    {vx, vy} = track.velocity
    {k, l} = {track.var / spread, track.pv / spread}
    again? = at_ms - track.first_ms > @found_ms and not track.found?
    seen = if again?, do: 1, else: track.seen + 1

    %{
      track
      | at: {x + k * dx, y + k * dy},
        velocity: {vx + l * dx, vy + l * dy},
        var: (1 - k) * track.var,
        pv: (1 - k) * track.pv,
        vv: track.vv - l * track.pv,
        seen_ms: max(at_ms, track.seen_ms),
        first_ms: if(again?, do: at_ms, else: track.first_ms),
        seen: min(seen, 1_000),
        found?: track.found? or seen >= @found,
        outside: 0
    }
  end

  defp predict(%{at_ms: before} = track, at_ms) when at_ms <= before, do: track

  defp predict(%{at: {x, y}, velocity: {vx, vy}} = track, at_ms) do
    s = (at_ms - track.at_ms) / 1000
    noise = if abs(vx) + abs(vy) > @slow, do: @noise, else: @lying

    %{
      track
      | at: {x + vx * s, y + vy * s},
        var: track.var + 2 * s * track.pv + s * s * track.vv + noise * s * s * s / 3,
        pv: track.pv + s * track.vv + noise * s * s / 2,
        vv: track.vv + noise * s,
        at_ms: at_ms
    }
  end

  @doc "Where the ball is at this time, and the standard deviation of that in metres; a second after the last sighting it is taken to lie."
  @spec place(t(), integer()) :: {Pose.point(), sd :: float()}
  def place(%__MODULE__{seen_ms: seen_ms} = track, at_ms) do
    %{at: at} = track |> predict(min(at_ms, seen_ms + @ahead_ms))
    %{var: var} = predict(track, at_ms)
    {at, :math.sqrt(var)}
  end

  @doc "Its speed in m/s at this time."
  @spec speed(t(), integer()) :: float()
  def speed(%__MODULE__{velocity: {vx, vy}, seen_ms: seen_ms}, at_ms) do
    if at_ms - seen_ms > @ahead_ms, do: 0.0, else: :math.sqrt(vx * vx + vy * vy)
  end

  @doc "What is known of the ball at this time."
  @spec state(t() | nil, integer()) :: :unseen | :seen | :found | :lost
  def state(nil, _at_ms), do: :unseen
  def state(%{seen_ms: seen_ms}, at_ms) when at_ms - seen_ms > @lost_ms, do: :lost
  def state(%{found?: found?}, _at_ms), do: if(found?, do: :found, else: :seen)
end
