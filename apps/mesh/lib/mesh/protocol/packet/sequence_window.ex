defmodule Mesh.Protocol.Packet.SequenceWindow do
  @moduledoc """
  Remembers the sequence numbers of a session that were heard: each counts once, and one that is 1,024 or more behind
  the newest not at all. Pure.
  """
  import Bitwise

  @width 1_024
  @full (1 <<< @width) - 1

  # Bit k of `seen` stands for the number `top - k`.
  @enforce_keys [:top, :seen]
  defstruct @enforce_keys

  @type t :: %__MODULE__{top: integer(), seen: non_neg_integer()}

  @doc """
  The window of a session of which this number is the first to be heard. All before it count as
  heard, because some of them were refused and may have been recorded.

      iex> alias Mesh.Protocol.Packet.SequenceWindow
      iex> {:ok, window} = SequenceWindow.take(SequenceWindow.new(7), 9)
      iex> for sequence <- 6..10, do: SequenceWindow.seen?(window, sequence)
      [true, false, false, true, false]
  """
  @spec new(non_neg_integer()) :: t()
  def new(sequence), do: %__MODULE__{top: sequence - 1, seen: @full}

  @doc "Whether this number was heard, or is too far behind to tell."
  @spec seen?(t(), non_neg_integer()) :: boolean()
  def seen?(%__MODULE__{top: top}, sequence) when sequence > top, do: false
  def seen?(%__MODULE__{top: top}, sequence) when top - sequence >= @width, do: true
  def seen?(window, sequence), do: (window.seen &&& 1 <<< (window.top - sequence)) != 0

  @doc "Whether this number is too far behind to tell whether it was heard."
  @spec behind?(t(), non_neg_integer()) :: boolean()
  def behind?(%__MODULE__{top: top}, sequence), do: top - sequence >= @width

  @doc "The window after this number was heard; `:doubled` if it was before."
  @spec take(t(), non_neg_integer()) :: {:ok, t()} | :doubled
  def take(%__MODULE__{top: top} = window, sequence) when sequence > top do
    shift = sequence - top
    seen = if shift >= @width, do: 0, else: window.seen <<< shift &&& @full
    {:ok, %{window | top: sequence, seen: seen ||| 1}}
  end

  def take(%__MODULE__{top: top} = window, sequence) do
    if seen?(window, sequence),
      do: :doubled,
      else: {:ok, %{window | seen: window.seen ||| 1 <<< (top - sequence)}}
  end
end
