defmodule Lab.Recording.Pictures do
  @moduledoc """
  Decides which camera pictures of a run are recorded, and what is drawn on them: for people, and never an
  input of a replay. Pure.
  """
  alias Hal.Frame
  alias Mcap.Foxglove
  alias Lab.Trial
  alias Lab.Trial.Mechanics

  @tick_ms 100
  @lowest 0.1
  @highest 5

  @doc "How many pictures a second of each robot can be recorded: the lowest and the highest rate."
  @spec rates() :: {number(), number()}
  def rates, do: {@lowest, @highest}

  @doc """
  The pictures that are due in the tick that begins now, at a rate in pictures a second; `nil` is
  none. Robots take turns, so that no tick has the pictures of all of them.
  """
  @spec due(Trial.t(), number() | nil) :: [{atom(), Frame.t()}]
  def due(_trial, nil), do: []

  def due(%Trial{at_ms: at_ms} = trial, rate) do
    living = Trial.living(trial)

    for {id, place} <- Enum.with_index(trial.options.robots),
        due?(place, at_ms, rate),
        id in living and Sim.World.camera?(trial.world, id),
        do: {id, Mechanics.frame(trial, id)}
  end

  @doc """
  Whether a robot's picture is due in the tick that begins at `at_ms`, by its place in the fleet.

      iex> for at_ms <- [0, 100, 200, 300, 400, 500], do: Lab.Recording.Pictures.due?(1, at_ms, 2)
      [false, true, false, false, false, false]
  """
  @spec due?(non_neg_integer(), non_neg_integer(), number()) :: boolean()
  def due?(place, at_ms, rate) do
    every = max(round(1000 / rate / @tick_ms), 1)
    rem(div(at_ms, @tick_ms), every) == rem(place, every)
  end

  @doc "The picture as a message; `at_ms` is when it was taken."
  @spec picture(atom(), at_ms :: non_neg_integer(), jpeg :: binary()) :: iodata()
  def picture(id, at_ms, jpeg),
    do: Foxglove.compressed_image(at_ms * 1_000_000, "#{id}", jpeg, "jpeg")
end
