defmodule Mesh.Backoff do
  @moduledoc """
  When to try again: at growing intervals, for ever, each a little different, so that a fleet that
  was cut apart does not knock in step. Pure: chance is handed in.
  """

  @first_ms 200
  @longest_ms 5_000

  @enforce_keys [:due_ms]
  defstruct @enforce_keys ++ [delay_ms: @first_ms]

  @type t :: %__MODULE__{due_ms: integer(), delay_ms: pos_integer()}

  @doc "Due at once."
  @spec new(integer()) :: t()
  def new(now_ms), do: %__MODULE__{due_ms: now_ms}

  @doc "Whether it is time."
  @spec due?(t(), integer()) :: boolean()
  def due?(%__MODULE__{due_ms: due_ms}, now_ms), do: now_ms >= due_ms

  @doc """
  After a try: the next one is twice as far off, 5 s at most, give or take a quarter. `chance` is
  from 0.0 to 1.0.

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
