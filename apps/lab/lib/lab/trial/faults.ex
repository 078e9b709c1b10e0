defmodule Lab.Trial.Faults do
  @moduledoc false
  # Describes what robots of a run lack for a time: their processor, their camera, their ears. Pure; times in
  # milliseconds.

  # A real base stops its wheels when no speed has come for so long (`Sim.World.Server`).
  @wheels_ms 200

  defstruct all: []

  @type kind :: :frozen | :blind | :deaf
  @type t :: %__MODULE__{
          all: [{kind(), robot :: atom(), from_ms :: integer(), to_ms :: integer()}]
        }

  @doc "The fault that an event of this name brings."
  @spec kind(event :: :freeze | :blind | :deaf) :: kind()
  def kind(:freeze), do: :frozen
  def kind(kind) when kind in [:blind, :deaf], do: kind

  @doc "Adds a fault."
  @spec add(t(), kind(), atom(), integer(), integer()) :: t()
  def add(faults, kind, robot, from_ms, to_ms),
    do: %{faults | all: [{kind, robot, from_ms, to_ms} | faults.all]}

  @doc """
  Whether a robot has a fault of one of these kinds.

      iex> faults = Lab.Trial.Faults.add(%Lab.Trial.Faults{}, :blind, :mag1, 1_000, 2_000)
      iex> for at_ms <- [999, 1_000, 2_000], do: Lab.Trial.Faults.any?(faults, [:blind], :mag1, at_ms)
      [false, true, false]
  """
  @spec any?(t(), [kind()], atom(), integer()) :: boolean()
  def any?(faults, kinds, robot, at_ms) do
    Enum.any?(faults.all, fn {kind, id, from_ms, to_ms} ->
      id == robot and kind in kinds and from_ms <= at_ms and at_ms < to_ms
    end)
  end

  @doc """
  Of what robots claim, that of those that are not frozen: what a frozen one claimed last is nothing that it says now.

      iex> faults = Lab.Trial.Faults.add(%Lab.Trial.Faults{}, :frozen, :mag1, 0, 2_000)
      iex> Lab.Trial.Faults.awake(faults, [mag1: %{phase: :lead}, mag2: %{phase: :follow}], 500)
      [mag2: %{phase: :follow}]
  """
  @spec awake(t(), [{atom(), map()}], integer()) :: [{atom(), map()}]
  def awake(faults, claims, at_ms),
    do: Enum.reject(claims, fn {id, _claim} -> any?(faults, [:frozen], id, at_ms) end)

  @doc "The robots whose wheels stand because they are frozen."
  @spec halted(t(), integer()) :: [atom()]
  def halted(faults, at_ms) do
    for {:frozen, id, from_ms, to_ms} <- faults.all,
        from_ms + @wheels_ms <= at_ms and at_ms < to_ms,
        uniq: true,
        do: id
  end

  @doc """
  The directions of the radio that faults cut: a frozen robot neither hears nor sends, a deaf one
  does not hear.

      iex> faults = Lab.Trial.Faults.add(%Lab.Trial.Faults{}, :deaf, :mag1, 0, 2_000)
      iex> Lab.Trial.Faults.ways(faults, [:mag1, :mag2, :mag3], 500)
      [mag2: :mag1, mag3: :mag1]
  """
  @spec ways(t(), [atom()], integer()) :: [{from :: atom(), to :: atom()}]
  def ways(faults, robots, at_ms) do
    for to <- robots, from <- robots, from != to, cut?(faults, from, to, at_ms), do: {from, to}
  end

  defp cut?(faults, from, to, at_ms),
    do: any?(faults, [:frozen, :deaf], to, at_ms) or any?(faults, [:frozen], from, at_ms)
end
