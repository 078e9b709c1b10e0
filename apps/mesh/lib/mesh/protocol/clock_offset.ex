defmodule Mesh.Protocol.ClockOffset do
  @moduledoc """
  Estimates how another node's monotonic clock stands to this one's, and so how old its datagrams are. Pure;
  times are in ms.

  Monotonic clocks start anywhere and say nothing about the time of day. So a node challenges the
  other at `asked_ms` by its own clock, and the signed answer carries `told_ms` by the other's.
  The answer was made after the challenge; hence what the other stamps with `told_ms + t` was made
  at `asked_ms + t` at the earliest. The age that follows is never too small, and too large by at
  most the round trip. Holding an answer back makes datagrams look older, not younger.

  Both clocks may drift, because Erlang corrects its monotonic clock by up to 1 %. The age
  therefore grows by 2 % of the time since the measurement: after a minute and a half without a
  new one nothing of that node is fresh.
  """

  # A datagram is fresh up to this age.
  @fresh_ms 2_000
  # An answer that took longer says too little.
  @round_trip_ms 1_000
  # Both clocks are read in whole milliseconds.
  @rounding_ms 2
  @drift_divisor 50
  @renew_ms 10_000

  @enforce_keys [:asked_ms, :told_ms]
  defstruct @enforce_keys

  @type t :: %__MODULE__{asked_ms: integer(), told_ms: integer()}

  @doc """
  The measurement by an answer that is heard now; `:error` if it took more than 1 s, or answers
  what has not been asked yet.

      iex> alias Mesh.Protocol.ClockOffset
      iex> {:ok, clock} = ClockOffset.measure(100, 7_000, 120)
      iex> ClockOffset.age_ms(clock, 7_050, 160)
      11
      iex> ClockOffset.measure(100, 7_000, 1_101)
      :error
  """
  @spec measure(asked_ms :: integer(), told_ms :: integer(), now_ms :: integer()) ::
          {:ok, t()} | :error
  def measure(asked_ms, told_ms, now_ms) when (now_ms - asked_ms) in 0..@round_trip_ms,
    do: {:ok, %__MODULE__{asked_ms: asked_ms, told_ms: told_ms}}

  def measure(_asked_ms, _told_ms, _now_ms), do: :error

  @doc "The age that a datagram with this stamp of its sender has at most."
  @spec age_ms(t(), stamp_ms :: integer(), now_ms :: integer()) :: integer()
  def age_ms(clock, stamp_ms, now_ms),
    do: now_ms - clock.asked_ms - (stamp_ms - clock.told_ms) + drift_ms(clock, now_ms)

  @doc """
  Whether a datagram with this stamp was made within the last 2 s. One that seems to come from the
  future is not fresh either: one of the clocks has stood still since, as in a suspended computer.

      iex> alias Mesh.Protocol.ClockOffset
      iex> {:ok, clock} = ClockOffset.measure(0, 50_000, 0)
      iex> for stamp_ms <- [51_000, 51_060, 53_000, 53_200], do: ClockOffset.fresh?(clock, stamp_ms, 3_000)
      [false, true, true, false]
  """
  @spec fresh?(t(), stamp_ms :: integer(), now_ms :: integer()) :: boolean()
  def fresh?(clock, stamp_ms, now_ms) do
    # What drift adds to the age it may also take from it.
    earliest_ms = -@rounding_ms
    age_ms(clock, stamp_ms, now_ms) in earliest_ms..@fresh_ms
  end

  @doc "Whether it is time for a new measurement: after 10 s."
  @spec due?(t(), integer()) :: boolean()
  def due?(clock, now_ms), do: now_ms - clock.asked_ms >= @renew_ms

  defp drift_ms(clock, now_ms), do: div(now_ms - clock.asked_ms, @drift_divisor)
end
