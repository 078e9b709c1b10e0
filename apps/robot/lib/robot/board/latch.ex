defmodule Robot.Board.Latch do
  @moduledoc false
  # The table of the e-stop latch, and its way into the file. A robot whose table has ended is held.
  alias Robot.Board.Files

  @again_ms 100
  @longest_ms 5_000

  @doc "A table, and what its file says."
  @spec new(latched? :: boolean()) :: :ets.tid()
  def new(latched?) do
    table = :ets.new(__MODULE__, [:public])
    :ets.insert(table, {:file, latched?})
    if latched?, do: set(table)
    table
  end

  @doc "Sets it."
  @spec set(:ets.tid()) :: true
  def set(table), do: :ets.insert(table, {:estop, true})

  @doc "Clears it."
  @spec clear(:ets.tid()) :: true
  def clear(table), do: :ets.delete(table, :estop)

  @doc "Whether it is set."
  @spec set?(:ets.tid()) :: boolean()
  def set?(table) do
    :ets.member(table, :estop)
  rescue
    ArgumentError -> true
  end

  @doc "Whether its file says what it does."
  @spec saved?(:ets.tid()) :: boolean()
  def saved?(table), do: file(table) == [{:file, set?(table)}]

  @doc "What its file did not take at the last attempt; `nil` if it did."
  @spec unsaved(:ets.tid()) :: Files.fault() | nil
  def unsaved(table),
    do: with([{:file, {:error, fault}}] <- file(table), do: fault, else: (_ -> nil))

  defp file(table) do
    :ets.lookup(table, :file)
  rescue
    ArgumentError -> []
  end

  @doc """
  Makes the file like the latch as it is now. If it cannot, `{:latch, ref}` comes to the calling process when that is to
  be tried again; only the last one counts. `again` is `nil`, or what this returned before.
  """
  @spec save(:ets.tid(), Files.t(), again) :: {Files.t(), again}
        when again: {reference(), wait_ms :: pos_integer()} | nil
  def save(table, files, again) do
    latched? = set?(table)

    case Files.latch(files, latched?) do
      {:ok, files} ->
        :ets.insert(table, {:file, latched?})
        {files, nil}

      {{:error, _fault} = error, files} ->
        :ets.insert(table, {:file, error})
        wait_ms = with {_ref, before_ms} <- again, do: min(2 * before_ms, @longest_ms)
        {files, later(wait_ms || @again_ms)}
    end
  end

  defp later(wait_ms) do
    ref = make_ref()
    Process.send_after(self(), {:latch, ref}, wait_ms)
    {ref, wait_ms}
  end
end
