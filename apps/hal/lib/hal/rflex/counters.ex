defmodule Hal.RFlex.Counters do
  @moduledoc false
  # Counts what went wrong on a driver's line since it was opened, and reports it.
  alias Hal.{Event, SerialBase}
  alias Hal.RFlex.{Driver, Readings, Schedule}

  @tell_ms 10_000

  @doc "How often the counts are reported, in milliseconds."
  @spec tell_ms() :: pos_integer()
  def tell_ms, do: @tell_ms

  @doc "The counts (`Hal.RFlex.Driver.counts/1`)."
  @spec counts(Driver.t()) :: %{atom() => non_neg_integer()}
  def counts(s) do
    s.decoder
    |> Map.take([:packets, :skipped, :given_up, :ghosts])
    |> Map.merge(Readings.counts(s.senses))
    |> Map.merge(%{refused: s.refused, overruns: s.overruns})
  end

  @doc "Emits an event, at most every 10 s, if more has been lost or refused since the last one."
  @spec tell(Driver.t(), integer()) :: Driver.t()
  def tell(s, at_ms) do
    if Schedule.due?(s, :tell, at_ms) do
      counts = counts(s)
      lost = Map.drop(counts, [:packets])

      if lost != s.told,
        do:
          Event.execute([:hal, :rflex, :lost], Map.put(counts, :at_ms, at_ms), %{
            port: SerialBase.Options.line_name(s.options)
          })

      Schedule.again(%{s | told: lost}, :tell, at_ms, @tell_ms)
    else
      s
    end
  end
end
