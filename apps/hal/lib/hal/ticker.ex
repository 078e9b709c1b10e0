defmodule Hal.Ticker do
  @moduledoc """
  Sends its owner the same message again and again, at absolute times, so that the pace does not
  drift. Missed ticks are not made up for. The owner requests each tick after it has handled the
  last one. A request replaces the one before, so that a tick that somebody else sent does not
  double the pace for ever.
  """
  @enforce_keys [:message, :period_ms, :due_ms]
  defstruct @enforce_keys ++ [timer: nil]

  @typedoc "`due_ms` is when the next message is due, or the last one was due, in monotonic time."
  @type t :: %__MODULE__{
          message: term(),
          period_ms: pos_integer(),
          due_ms: integer(),
          timer: reference() | nil
        }

  @doc "Sends the caller the first `message`, `first_ms` from now."
  @spec start(message :: term(), period_ms :: pos_integer(), first_ms :: non_neg_integer()) :: t()
  def start(message, period_ms, first_ms),
    do:
      arm(%__MODULE__{
        message: message,
        period_ms: period_ms,
        due_ms: Hal.Clock.now_ms() + first_ms
      })

  @doc """
  Sends the caller the next message; for `nil`, when something else sets the pace, sends nothing.
  """
  @spec next(t()) :: t()
  @spec next(nil) :: nil
  def next(nil), do: nil

  def next(%__MODULE__{} = ticker),
    do: arm(%{ticker | due_ms: due(ticker.due_ms, ticker.period_ms, Hal.Clock.now_ms())})

  defp arm(ticker) do
    if ticker.timer, do: Process.cancel_timer(ticker.timer)
    %{ticker | timer: Process.send_after(self(), ticker.message, ticker.due_ms, abs: true)}
  end

  @doc """
  When the tick after that of `last_ms` is due: a period later, or now, if that has passed, and
  never later than a period from now, however many ticks somebody else sent.

      iex> {Hal.Ticker.due(1_000, 50, 1_020), Hal.Ticker.due(1_000, 50, 1_170)}
      {1_050, 1_170}
      iex> Hal.Ticker.due(9_000, 50, 1_020)
      1_070
  """
  @spec due(last_ms :: integer(), period_ms :: pos_integer(), now_ms :: integer()) :: integer()
  def due(last_ms, period_ms, now_ms),
    do: (last_ms + period_ms) |> max(now_ms) |> min(now_ms + period_ms)
end
