defmodule Console.Page.Guesses do
  @moduledoc false
  # Decides how often an address may say a token, and when a wrong one is worth a line. Pure; time in ms.
  #
  # Five wrong ones at once and two a second in the long run; then none is looked at, the right one neither, or the rate would
  # mean nothing. A browser that is in already has another proof than the token (`Console.Page.Access`), and is not asked.
  alias Mesh.Distribution.Access.Bucket

  @at_once 5
  @per_minute 120
  @line_ms 60_000
  @addresses 1_000

  defstruct addresses: %{}

  @typedoc "Of each address with wrong tokens: its bucket, how many were not told, when one was told last."
  @type t :: %__MODULE__{
          addresses: %{
            :inet.ip_address() => {Bucket.t(), untold :: non_neg_integer(), told_ms :: integer()}
          }
        }

  @doc """
  An address says a token, which is right or not. With it, how many wrong ones were not told of before this one, if this
  one is to be told: the first, and one a minute.

      iex> guesses = %Console.Page.Guesses{}
      iex> {:wrong, 0, guesses} = Console.Page.Guesses.guess(guesses, {10, 0, 0, 7}, false, 0)
      iex> {:ok, nil, guesses} = Console.Page.Guesses.guess(guesses, {10, 0, 0, 7}, true, 0)
      iex> guesses = Enum.reduce(1..4, guesses, fn _wrong, g -> elem(Console.Page.Guesses.guess(g, {10, 0, 0, 7}, false, 0), 2) end)
      iex> {:late, nil, _guesses} = Console.Page.Guesses.guess(guesses, {10, 0, 0, 7}, true, 400)
      iex> {:ok, nil, _guesses} = Console.Page.Guesses.guess(guesses, {10, 0, 0, 7}, true, 500)
      iex> {:wrong, 4, _guesses} = Console.Page.Guesses.guess(guesses, {10, 0, 0, 7}, false, 60_000)
  """
  @spec guess(t(), :inet.ip_address(), boolean(), integer()) ::
          {:ok | :wrong | :late, untold :: non_neg_integer() | nil, t()}
  def guess(guesses, address, right?, now_ms) do
    {bucket, untold, told_ms} = Map.get(guesses.addresses, address, {nil, 0, nil})

    case Bucket.take(bucket, @at_once, @per_minute, now_ms) do
      {:ok, _bucket} when right? -> {:ok, nil, guesses}
      {:ok, bucket} -> note(guesses, :wrong, address, {bucket, untold, told_ms}, now_ms)
      :error -> note(guesses, :late, address, {bucket, untold, told_ms}, now_ms)
    end
  end

  defp note(guesses, what, address, {bucket, untold, told_ms}, now_ms) do
    if told_ms == nil or now_ms - told_ms >= @line_ms,
      do: {what, untold, put(guesses, address, {bucket, 0, now_ms})},
      else: {what, nil, put(guesses, address, {bucket, untold + 1, told_ms})}
  end

  # The one that was told of longest ago makes room.
  defp put(%{addresses: addresses} = guesses, address, one)
       when is_map_key(addresses, address) or map_size(addresses) < @addresses,
       do: %{guesses | addresses: Map.put(addresses, address, one)}

  defp put(%{addresses: addresses} = guesses, address, one) do
    {oldest, _one} = Enum.min_by(addresses, fn {_address, {_, _, told_ms}} -> told_ms end)
    put(%{guesses | addresses: Map.delete(addresses, oldest)}, address, one)
  end
end
