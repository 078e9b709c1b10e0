defmodule Lab.Check.Stops do
  @moduledoc false
  # Judges how an emergency stop spreads. Pure; fed every 100 ms.
  #
  # `stop_lost`: a stop that holds one robot of a part of the radio holds all of that part, but those
  # that a person has reset since. Heartbeats carry it at 5 Hz, so it is given 2 s, the time after which
  # a robot from which nothing comes is gone (docs/times.md), divided by (1 - loss)^2.
  @behaviour Lab.Check.Kind
  alias Lab.Check.{Leaders, Violation}
  alias Swarm.EStop

  @spread_ms 2_000

  @enforce_keys [:limit_ms]
  defstruct @enforce_keys ++ [missing: %{}]

  @type t :: %__MODULE__{
          limit_ms: pos_integer(),
          missing: %{{[atom()], atom(), EStop.State.tag()} => integer()}
        }

  @impl Lab.Check.Kind
  def new(%{loss: loss} = options) do
    factor = loss |> Leaders.worst(options) |> Leaders.factor()
    %__MODULE__{limit_ms: round(@spread_ms * factor)}
  end

  @impl Lab.Check.Kind
  def note(_asked, %{stops: nil}, _judge), do: :unseen

  def note(_asked, %{at_ms: at_ms, stops: stops, parts: parts}, judge) do
    missing =
      for part <- parts,
          tag <- Enum.uniq(for id <- part, stop = stops[id], tag <- stop.held, do: tag),
          id <- part,
          stop = stops[id],
          tag not in stop.held and tag not in stop.cleared,
          into: %{} do
        key = {part, id, tag}
        {key, Map.get(judge.missing, key, at_ms)}
      end

    wrong =
      for {{_part, id, _tag}, since} <- Enum.sort(missing), at_ms - since > judge.limit_ms do
        figures = "not held after #{Violation.decimals((at_ms - since) / 1000, 1)} s"
        Violation.new(:stop_lost, at_ms, [id], figures)
      end

    {:never, wrong, %{judge | missing: missing}}
  end
end
