defmodule Mesh.Distribution.Access.Bucket do
  @moduledoc """
  Limits the rate of one address by a token bucket. Pure; time in ms.

  An address may take `most` at once, and `per_minute` in the long run.
  """

  @typedoc "Thousandths of a token, and when they were counted."
  @type t :: {milli :: non_neg_integer(), at_ms :: integer()}

  @doc """
  Takes a token, if one is left; `nil` is a full bucket.

      iex> alias Mesh.Distribution.Access.Bucket
      iex> {:ok, bucket} = Bucket.take(nil, 2, 60, 0)
      iex> {:ok, bucket} = Bucket.take(bucket, 2, 60, 0)
      iex> Bucket.take(bucket, 2, 60, 999)
      :error
      iex> {:ok, {0, 1_000}} = Bucket.take(bucket, 2, 60, 1_000)
  """
  @spec take(t() | nil, most :: pos_integer(), per_minute :: pos_integer(), integer()) ::
          {:ok, t()} | :error
  def take(nil, most, _per_minute, now_ms), do: {:ok, {most * 1_000 - 1_000, now_ms}}

  # What is refused takes nothing: the fractions of many refusals add up.
  def take({milli, at_ms}, most, per_minute, now_ms) do
    case min(most * 1_000, milli + div((now_ms - at_ms) * per_minute, 60)) do
      left when left >= 1_000 -> {:ok, {left - 1_000, now_ms}}
      _too_little -> :error
    end
  end
end
