defmodule Swarm.Discovery.RobotInfo do
  @moduledoc """
  Describes a robot for searches (`Swarm.find/1`): the row `{robot, :about}` of
  the blackboard, written by the robot's comms process once a second, and at once when its mission
  changes.

  | field | value |
  |---|---|
  | `profile` | the name of its body, such as `:magellan` |
  | `battery` | volts, `nil` if it is not measured |
  | `calibrated` | `true` unless `say/2` says otherwise |
  | `mission`, `state` | what it is doing, such as `:landmark` and `:follow`, or `nil` and `:idle` |
  | `services` | what it has: `:drive`, `:camera`, `:ptz`, `:scan` (a lidar), the responders that run on it (roles `{:service, name}` of `Robot.Names`), and those from `say/2` |
  | `node`, `age_ms` | its node; the age of the row |

  `say/2`, on the robot's node, adds what only others know about a robot.

  Names travel as text, and stay text if this node has no such atom.
  """
  alias Robot.{Board, Names}
  alias Robot.Safety.LivenessMonitor
  alias Swarm.{Blackboard, Status}
  alias Swarm.Wire
  alias Swarm.Message.Receiver

  # A comms process ticks ten times a second.
  @every 10
  @sayable [:calibrated, :services]

  @enforce_keys [:robot]
  defstruct @enforce_keys ++
              [
                node: nil,
                profile: nil,
                battery: nil,
                calibrated: true,
                mission: nil,
                state: :idle,
                services: [],
                age_ms: nil
              ]

  @type t :: %__MODULE__{
          robot: atom(),
          node: Blackboard.Codec.word() | nil,
          profile: Blackboard.Codec.word() | nil,
          battery: number() | nil,
          calibrated: boolean(),
          mission: Blackboard.Codec.word() | nil,
          state: Blackboard.Codec.word(),
          services: [Blackboard.Codec.word()],
          age_ms: non_neg_integer() | nil
        }

  @typedoc "What of a board is written at once when it changes."
  @type seen :: term()
  @typedoc "What was last written, and in how many ticks it is written again."
  @type noted :: nil | {non_neg_integer(), seen()}

  @doc "What of a robot's board is written at once when it changes."
  @spec seen(Board.t()) :: seen()
  def seen(board) do
    health = Board.health(board, :drive)
    hung = for part <- LivenessMonitor.parts(), do: Board.fetch(board, {:hung, part}, :infinity)
    arming = Board.fetch(board, :arming, :infinity)
    {doing(board), Board.latched?(board), arming, health, hung}
  end

  @doc """
  Whether a robot's rows are written now, because it is time or something changed; called at each tick of its comms.

      iex> {true, noted} = Swarm.Discovery.RobotInfo.due(nil, :seen)
      iex> {Swarm.Discovery.RobotInfo.due(noted, :seen), Swarm.Discovery.RobotInfo.due(noted, :other)}
      {{false, {8, :seen}}, {true, {9, :other}}}
  """
  @spec due(noted(), seen()) :: {due? :: boolean(), noted()}
  def due({left, seen}, seen) when left > 0, do: {false, {left - 1, seen}}
  def due(_noted, seen), do: {true, {@every - 1, seen}}

  @doc "Writes a robot's rows `:about` and `:status`, from the process of its comms. Waits for nothing."
  @spec write(Robot.Config.t(), Board.t(), Receiver.t()) :: :ok
  def write(config, board, receiver) do
    status = Status.Row.encode(Status.of(config, board, receiver))
    Blackboard.note(config.id, config.boot, about: row(config, board), status: status)
  end

  defp doing(board) do
    case Board.fetch(board, :mission, :infinity) do
      {:ok, %{state: {module, phase}}, _at_ms} -> {module, phase}
      _idle -> nil
    end
  end

  defp row(config, board) do
    {mission, state} = words(doing(board))
    said = said(config.id)

    %{
      node: Atom.to_string(node()),
      profile: Atom.to_string(config.profile.name),
      battery: battery(board),
      calibrated: Keyword.get(said, :calibrated, true),
      mission: mission,
      state: state,
      services:
        Enum.uniq(devices(config) ++ offered(config.id) ++ Keyword.get(said, :services, []))
    }
  end

  defp words(nil), do: {nil, "idle"}

  defp words({module, phase}),
    do: {module |> Module.split() |> List.last() |> Macro.underscore(), Atom.to_string(phase)}

  defp battery(board) do
    case Board.fetch(board, :power, :infinity) do
      {:ok, volts, _at_ms} when is_number(volts) -> volts
      _unknown -> nil
    end
  end

  defp devices(config) do
    for device <- [:drive, :camera, :ptz, :scan],
        Map.get(config, device),
        do: Atom.to_string(device)
  end

  defp offered(robot) do
    names =
      for {:service, name} when is_atom(name) <- Names.roles(robot), do: Atom.to_string(name)

    Enum.sort(names)
  end

  defp said(robot) do
    with {:ok, said, _age_ms} <- Blackboard.get(robot, :said, :infinity),
         true <- Keyword.keyword?(said) do
      said
    else
      _nothing -> []
    end
  end

  @doc """
  Adds to a robot of this node what only others know about it; its next row contains it.

      Swarm.Discovery.RobotInfo.say(:mag1, calibrated: false)
      Swarm.Discovery.RobotInfo.say(:mag1, services: [:gripper])
  """
  @spec say(atom(), keyword()) :: :ok | {:error, line :: String.t()}
  def say(robot, facts) do
    case Keyword.keyword?(facts) and Enum.find(facts, &(not sayable?(&1))) do
      nil ->
        facts = Keyword.replace_lazy(facts, :services, &Enum.map(&1, fn name -> "#{name}" end))
        Blackboard.put(robot, :said, Keyword.merge(said(robot), facts))

      false ->
        {:error,
         "#{inspect(facts)} is not a list of facts; allowed are #{Enum.join(@sayable, ", ")}"}

      {key, value} ->
        {:error,
         "#{inspect(key)}: expected calibrated: true or false, or services: [:name], got #{inspect(value)}"}
    end
  end

  defp sayable?({:calibrated, on?}), do: is_boolean(on?)
  defp sayable?({:services, names}), do: Wire.names?(names)
  defp sayable?(_other), do: false

  @doc "What is known about a robot, unless it is older than this in ms."
  @spec of(atom(), non_neg_integer() | :infinity) :: {:ok, t()} | :error
  def of(robot, max_age_ms) do
    with {:ok, row, age_ms} <- Blackboard.get(robot, :about, max_age_ms),
         do: read(robot, row, age_ms)
  end

  @doc """
  Reads a row, whatever it contains.

      iex> Swarm.Discovery.RobotInfo.read(:mag1, %{junk: 1}, 5)
      :error
  """
  @spec read(atom(), term(), non_neg_integer()) :: {:ok, t()} | :error
  def read(robot, row, age_ms) do
    with %{node: node, profile: profile, battery: battery, calibrated: calibrated} <- row,
         %{mission: mission, state: state, services: services} <- row,
         true <- Enum.all?([node, profile, state], &is_binary/1),
         true <- is_boolean(calibrated) and (battery == nil or is_number(battery)),
         true <-
           (mission == nil or is_binary(mission)) and Wire.list?(services, &is_binary/1) do
      {:ok,
       %__MODULE__{
         robot: robot,
         node: Blackboard.Codec.word(node),
         profile: Blackboard.Codec.word(profile),
         battery: battery,
         calibrated: calibrated,
         mission: mission && Blackboard.Codec.word(mission),
         state: Blackboard.Codec.word(state),
         services: Enum.map(services, &Blackboard.Codec.word/1),
         age_ms: age_ms
       }}
    else
      _other -> :error
    end
  end
end
