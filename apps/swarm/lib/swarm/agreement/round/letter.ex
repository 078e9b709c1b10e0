defmodule Swarm.Agreement.Round.Letter do
  @moduledoc """
  Carries a message of a round. Every letter carries the round's id, its view and the remaining time (so no shared clock
  is needed), the sender's own report, and, once it is final, its digest. `known` is the map of all reports that the
  sender holds, sent as an echo when all reports have arrived, or on request. `purpose` says why the round is
  held.
  """
  alias Swarm.Wire

  @enforce_keys [:id, :view, :remaining_ms, :purpose]
  defstruct @enforce_keys ++ [report: nil, known: nil, digest: nil, ask: false]

  @type id :: {epoch :: pos_integer(), counter :: pos_integer(), initiator :: atom()}
  @type t :: %__MODULE__{
          id: id(),
          view: [atom()],
          remaining_ms: integer(),
          purpose: :search | :change,
          report: :busy | Swarm.Agreement.Election.report(),
          known: %{atom() => Swarm.Agreement.Election.report()} | nil,
          digest: binary() | nil,
          ask: boolean()
        }

  # Longer than any round lasts, more robots than any fleet has, and the tries of one epoch, after
  # which the next epoch begins.
  @longest_ms 120_000
  @most 1_000
  @tries 1_000_000

  @doc "The highest counter of an epoch's rounds."
  @spec tries() :: pos_integer()
  def tries, do: @tries

  @doc "Whether a term from outside is a letter; its view is not checked again if it equals one that was."
  @spec valid?(term(), known_view :: [atom()]) :: boolean()
  def valid?(term, known_view \\ [])

  def valid?(%__MODULE__{id: {epoch, counter, initiator}} = letter, known_view) do
    Wire.whole?(letter, __MODULE__) and Wire.counter?(epoch) and epoch > 0 and
      is_integer(counter) and counter in 1..@tries and Wire.name?(initiator) and
      Wire.number?(letter.remaining_ms) and letter.remaining_ms <= @longest_ms and
      letter.purpose in [:search, :change] and
      (letter.view == known_view or
         (Wire.names?(letter.view) and Wire.distinct?(letter.view))) and
      (letter.report == :busy or report?(letter.report)) and
      (letter.known == nil or known?(letter.known)) and
      (letter.digest == nil or (is_binary(letter.digest) and byte_size(letter.digest) == 32)) and
      is_boolean(letter.ask)
  end

  def valid?(_term, _known_view), do: false

  defp known?(known) when is_map(known) and not is_struct(known),
    do: Enum.all?(known, fn {id, report} -> Wire.name?(id) and report?(report) end)

  defp known?(_other), do: false

  defp report?(nil), do: true

  defp report?(%{merit: merit, pose: pose, led: led, of: of} = report) do
    map_size(report) == 4 and (merit == nil or merit in 0..1_000_000) and
      Wire.pose?(pose) and is_integer(led) and led in 0..@most and is_integer(of) and
      of in 0..@most
  end

  defp report?(_other), do: false
end
