defmodule Console.Cli.Condition do
  @moduledoc """
  Describes what keeps a robot from its work, for every view: dead, not heard, held by the emergency stop, disarmed, offline,
  crashed, lost, blocked. Pure.
  """

  @typedoc """
  One thing that is wrong: how much it means (`:stop` holds it, `:bad` needs a person, `:warn` may pass, `:off` it is gone), a
  word for it, and why, as far as that is known. `bars` says why the robot cannot move before a person has done something,
  `nil` if it can. Where `instead?` is true, the word says all that the robot's state does.
  """
  @type t :: %{
          kind: :stop | :bad | :warn | :off,
          word: String.t(),
          why: String.t() | nil,
          bars: String.t() | nil,
          instead?: boolean()
        }

  @doc """
  All that is wrong with a robot of a scene, the worst first; `[]` if nothing is.

      iex> Console.Cli.Condition.of(%{alive: true, state: :follow})
      []
      iex> held = %{alive: true, state: :estop, blocked_by: "mag2"}
      iex> for c <- Console.Cli.Condition.of(held), do: {c.kind, c.word, c.bars}
      [{:stop, "E-STOP", "held by the emergency stop until a reset"}, {:warn, "blocked", nil}]
      iex> [dead] = Console.Cli.Condition.of(%{alive: false, state: :dead, blocked_by: "mag2"})
      iex> {dead.word, dead.bars}
      {"dead", "dead"}
  """
  @spec of(
          Sim.Scene.robot()
          | %{:alive => boolean(), :state => term(), optional(atom()) => term()}
        ) ::
          [t()]
  def of(%{alive: false, state: :not_heard}),
    do: [wrong(:off, "not heard", nil, "not heard", true)]

  def of(%{alive: false}), do: [wrong(:off, "dead", nil, "dead", true)]

  def of(robot) do
    Enum.filter(
      [
        robot.state == :estop &&
          wrong(:stop, "E-STOP", nil, "held by the emergency stop until a reset", true),
        arming(robot[:arming]),
        offline(robot[:offline] || []),
        robot.state == "no answer" &&
          wrong(:bad, "no answer", "it is heard, but does not answer", nil, true),
        robot.state == :silent &&
          wrong(:bad, "silent", "its process says nothing", nil, true),
        robot[:crashed] && wrong(:bad, "crashed", robot.crashed),
        robot[:fault] && wrong(:bad, "fault", robot.fault),
        lost(robot),
        blocked(robot)
      ],
      & &1
    )
  end

  @doc "Why a robot cannot move before a person has done something, by its conditions; `nil` if it can."
  @spec bars([t()]) :: String.t() | nil
  def bars(conditions), do: Enum.find_value(conditions, & &1.bars)

  defp arming(nil), do: nil

  defp arming({:disarmed, why}),
    do: wrong(:warn, "disarmed", why, "disarmed: arm it first", true)

  defp arming({:line_lost, why}),
    do: wrong(:bad, "line lost", why, "line lost: acknowledge that first", true)

  defp offline([]), do: nil

  defp offline(devices) do
    names = Enum.map_join(devices, ", ", &to_string/1)
    drive? = Enum.any?(devices, &(to_string(&1) == "drive"))
    wrong(:bad, "offline", names, if(drive?, do: "the drive is offline"))
  end

  # One that does not know its place says why.
  defp lost(%{state: :unsure} = robot), do: wrong(:warn, "not sure", robot[:says], nil, true)
  defp lost(%{lost: true} = robot), do: wrong(:warn, "lost", robot[:says])
  defp lost(_robot), do: nil

  defp blocked(%{state: :blocked} = robot),
    do: wrong(:warn, "blocked", by(robot[:blocked_by]), nil, true)

  defp blocked(%{blocked_by: "" <> what}), do: wrong(:warn, "blocked", by(what))
  defp blocked(_robot), do: nil

  defp by(nil), do: nil
  defp by(what), do: "by #{what}"

  defp wrong(kind, word, why, bars \\ nil, instead? \\ false),
    do: %{kind: kind, word: word, why: why, bars: bars, instead?: instead?}
end
