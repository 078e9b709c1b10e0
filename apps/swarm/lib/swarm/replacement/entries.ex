defmodule Swarm.Replacement.Entries do
  @moduledoc false
  # Describes what `Swarm.Replacement.Server` reads on the boards of its node's robots, and what it writes there for people. A robot
  # that has just ended has no entries.
  alias Hal.Event
  alias Robot.{Board, Names}
  alias Robot.Mission.Manual
  alias Swarm.MissionRegistry
  alias Swarm.Replacement.{Job, Order}

  # Slower wheels rest; m/s, rad/s.
  @rest_linear 0.02
  @rest_turn 0.05

  @typedoc "What was put in the place of the mission of the robot's config, if anything (`Robot.Board`)."
  @type noted :: %{mission: Job.mission() | nil, changing?: boolean(), says: String.t()} | nil

  @doc "Whether the robot's config allows another mission; the error is one line."
  @spec allowed(atom()) :: :ok | {:error, line :: String.t()}
  def allowed(robot) do
    case entry(robot, :release) do
      %{replace: true} -> :ok
      _off -> {:error, "its mission cannot be replaced: its file does not say replace: true"}
    end
  end

  @doc "Whether the emergency stop holds it."
  @spec held?(atom()) :: boolean()
  def held?(robot), do: with({:ok, board} <- Board.find(robot), do: Board.latched?(board)) == true

  @doc "The mission that it is on; `nil` for none, and for an order that a person gave to it alone."
  @spec running(atom()) :: Job.mission() | nil
  def running(robot) do
    case entry(robot, :mission) do
      %{state: {module, _phase}, options: options} when module != Manual -> {module, options}
      _idle_or_alone -> nil
    end
  end

  @doc "Whether its wheels turn, by their last report."
  @spec turns?(atom()) :: boolean()
  def turns?(robot) do
    case entry(robot, :odometry) do
      %{twist: %{linear: linear, turn: turn}} ->
        abs(linear) > @rest_linear or abs(turn) > @rest_turn

      _no_wheels ->
        false
    end
  end

  @doc "What was noted of it last."
  @spec noted(atom()) :: noted()
  def noted(robot), do: entry(robot, :replaced)

  defp entry(robot, key) do
    with {:ok, board} <- Board.find(robot),
         {:ok, value, _at_ms} <- Board.fetch(board, key, :infinity),
         do: value,
         else: (:error -> nil)
  end

  @doc "Notes that its own mission is back because what came in its place is not known."
  @spec forget(atom(), why :: String.t()) :: :ok
  def forget(robot, why) do
    _put =
      put(robot, %{mission: nil, changing?: false, says: "has its own mission again: #{why}"})

    :ok
  end

  @doc """
  Notes how far an order has come, on the board and as a stage. `before` is what was noted when it began.
  """
  @spec note(atom(), {what :: atom(), why :: String.t() | nil}, Order.t(), Job.t(), noted()) ::
          :ok
  def note(robot, {what, why}, order, job, before) do
    mission =
      if what in [:replaced, :kept],
        do: job.mission,
        else: with(%{mission: mission} <- before, do: mission)

    {module, _options} = job.mission
    says = says(what, why, MissionRegistry.name(module), order.from)
    about = %{robot: robot, stage: :replacement, what: what, from: order.from}

    with {:ok, at_ms} <-
           put(robot, %{mission: mission, changing?: what == :changing, says: says}),
         do: Event.execute([:robot, :stage], %{at_ms: at_ms}, Map.put(about, :says, says))

    :ok
  end

  defp put(robot, noted) do
    with {:ok, board} <- Board.find(robot) do
      at_ms = Board.now(board)
      :ok = Board.put(board, :replacement, :replaced, noted, at_ms)
      {:ok, at_ms}
    end
  end

  defp says(:changing, _why, mission, from), do: "is given #{mission} by #{from}"
  defp says(:replaced, _why, mission, from), do: "was given #{mission} by #{from}"
  defp says(:kept, _why, mission, from), do: "keeps #{mission}, given by #{from}"
  defp says(:back, why, mission, from), do: "went back from #{mission}, given by #{from}: #{why}"

  @doc "The robots of this node that an order is for."
  @spec meant(Order.t()) :: [atom()]
  def meant(%Order{to: to}), do: Enum.filter(Names.robots(), &(Atom.to_string(&1) in to))
end
