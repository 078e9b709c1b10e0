defmodule Mesh.Backoff do
  @moduledoc """
  Decides when to try again: for ever, at growing intervals, each a little random, so that the nodes of a
  fleet that was cut apart do not all retry at the same time. Pure: the random number is passed
  in.
  """

  @first_ms 200
  @longest_ms 5_000

  @enforce_keys [:due_ms]
  defstruct @enforce_keys ++ [delay_ms: @first_ms]

  @type t :: %__MODULE__{due_ms: integer(), delay_ms: pos_integer()}

  @doc "The state in which a try is due at once."
  @spec new(integer()) :: t()
  def new(now_ms), do: %__MODULE__{due_ms: now_ms}

  @doc "Whether a try is due."
  @spec due?(t(), integer()) :: boolean()
  def due?(%__MODULE__{due_ms: due_ms}, now_ms), do: now_ms >= due_ms

  @doc """
  The state after a try: the next interval is twice as long, at most 5 s, give or take a quarter.
  `chance` is from 0.0 to 1.0.

      iex> backoff = Mesh.Backoff.new(0) |> Mesh.Backoff.tried(0, 0.5)
      iex> {backoff.due_ms, Mesh.Backoff.tried(backoff, 200, 1.0).due_ms}
      {200, 700}
  """
  @spec tried(t(), integer(), float()) :: t()
  def tried(%__MODULE__{delay_ms: delay_ms}, now_ms, chance) do
    wait_ms = round(delay_ms * (0.75 + chance / 2))
    %__MODULE__{due_ms: now_ms + wait_ms, delay_ms: min(2 * delay_ms, @longest_ms)}
  end
end
