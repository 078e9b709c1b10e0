defmodule Swarm.Link.Orders do
  @moduledoc """
  What a robot's link does with the orders of people, and how an e-stop spreads.

  E-stops are numbered: a new one is one more than any that the robot has heard of, and the number
  travels in every heartbeat. So one which a person has cleared here is not caught again from a
  robot that is still to be reset. The numbers are on the board, for the link that comes after a
  failure of this one.
  """
  alias Robot.{Board, Config, Gate, Pilot}
  alias Swarm.Missions.Manual

  @typedoc "The link's state; these orders read and change only what is named here."
  @type link :: %{
          required(:id) => atom(),
          required(:board) => Board.t(),
          required(:config) => Config.t(),
          required(:stop) => non_neg_integer(),
          required(:cleared) => non_neg_integer(),
          optional(atom()) => term()
        }

  @type answer :: :ok | {:ok, map()} | {:error, :idle | :no_mission}

  @doc "The number of the last e-stop that this robot knew, and of the last one cleared here."
  @spec stops(Board.t()) :: {non_neg_integer(), non_neg_integer()}
  def stops(board) do
    case Board.fetch(board, :estop, :infinity) do
      {:ok, numbers, _at_ms} -> numbers
      :error -> {0, 0}
    end
  end

  @doc "For a link that starts: a stop written down by the one before may not have reached the gate."
  @spec resume(link()) :: :ok
  def resume(link) do
    if link.stop > link.cleared, do: :ok = Gate.estop(link.id)
    :ok
  end

  @doc "Does what a person ordered. `:ok` means accepted, not done."
  @spec obey(command :: term(), link()) :: {answer(), link()}
  def obey(:estop, link), do: {:ok, estop(link, max(link.stop, link.cleared) + 1)}

  def obey(:reset, link) do
    :ok = Gate.reset(link.id)
    {:ok, numbered(%{link | cleared: link.stop})}
  end

  def obey(:status, link), do: {{:ok, Board.entries(link.board)}, link}
  def obey(:ping, link), do: {:ok, link}
  def obey(:start, link), do: {run(link, link.config.mission, :start), link}

  # A robot that has no mission stands already.
  def obey(:stop, link) do
    case Pilot.command(link.id, :stop) do
      {:error, :idle} -> {:ok, link}
      answer -> {answer, link}
    end
  end

  def obey(command, link) do
    if Manual.command?(command),
      do: {run(link, {Manual, []}, command), link},
      else: {Pilot.command(link.id, command), link}
  end

  @doc "Takes over an e-stop of this number, unless it is one that was cleared here."
  @spec estop(link(), pos_integer()) :: link()
  def estop(%{cleared: cleared} = link, stop) when stop <= cleared,
    do: numbered(%{link | stop: stop})

  # Written down first: a link that starts in between knows that there is something to do.
  def estop(link, stop) do
    link = numbered(%{link | stop: stop})
    :ok = Gate.estop(link.id)
    link
  end

  # A mission that is running already is not begun anew: it takes the command as it is.
  defp run(_link, nil, _command), do: {:error, :no_mission}

  defp run(link, {module, options}, command) do
    begun = if running(link) == module, do: :ok, else: Pilot.start(link.id, module, options)
    with :ok <- begun, do: Pilot.command(link.id, command)
  end

  defp running(link) do
    case Board.fetch(link.board, :mission, :infinity) do
      {:ok, %{state: {module, _phase}}, _at_ms} -> module
      _idle_or_none -> :idle
    end
  end

  defp numbered(link) do
    at_ms = Config.now(link.config)
    Board.put(link.board, :link, :estop, {link.stop, link.cleared}, at_ms)
    link
  end
end
