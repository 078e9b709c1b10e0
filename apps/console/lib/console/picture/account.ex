defmodule Console.Picture.Account do
  @moduledoc false
  # Tells how a robot fared at the end of a run, and why, in the words of its claim, as the summary does
  # (`Console.Report`). Pure.
  alias Console.Cli.Format
  alias Console.Picture.RunTrack
  alias Hal.Pose
  alias Sim.Scene

  # Metres from where a robot is to where it believes to be that are worth showing.
  @off 0.2

  @doc """
  What a robot does, and why.

      iex> robot = %{alive: true, leader?: false, state: :blocked, blocked_by: "mag3", says: nil}
      iex> Console.Picture.Account.doing(robot)
      "blocked by mag3"
      iex> Console.Picture.Account.doing(%{robot | state: :unsure, blocked_by: nil, says: "lost: nothing fits"})
      "lost: nothing fits"
      iex> Console.Picture.Account.doing(%{robot | state: :in_place, blocked_by: nil})
      "in its place"
  """
  @spec doing(Scene.robot()) :: String.t()
  def doing(%{alive: false}), do: "dead"
  def doing(%{state: :estop}), do: "held by the emergency stop"

  def doing(robot) do
    blocked = if robot[:blocked_by], do: ["blocked by #{robot.blocked_by}"], else: []

    case blocked ++ List.wrap(robot[:says]) do
      [] -> plain(robot)
      words -> if(robot.leader?, do: "leads: ", else: "") <> Enum.join(words, "; ")
    end
  end

  defp plain(%{leader?: true}), do: "leads"
  defp plain(%{state: :in_place}), do: "in its place"
  defp plain(%{state: :follow}), do: "on its way"
  defp plain(%{state: :unsure}), do: "not sure of its place"
  defp plain(%{state: state}), do: state |> Atom.to_string() |> String.replace("_", " ")

  @doc "Whether a robot's end needs to be explained: it is neither where it should be, nor dead, nor does it lead in silence."
  @spec trouble?(Scene.robot()) :: boolean()
  def trouble?(%{alive: false}), do: false

  def trouble?(robot),
    do: robot.state in [:blocked, :unsure, :follow] or robot[:says] != nil or off_m(robot) != nil

  @doc """
  How sure a robot is of its place, and since when it stands; `""` where neither is known. What it does may say the first.

      iex> Console.Picture.Account.doubt(%{alive: true, uncertainty: 0.31}, 41.2)
      "±0.31 m, since 41.2 s"
      iex> Console.Picture.Account.doubt(%{alive: true, uncertainty: 0.31}, nil)
      "±0.31 m"
  """
  @spec doubt(Scene.robot() | map(), since_s :: float() | nil) :: String.t()
  def doubt(%{alive: false}, _since_s), do: ""

  def doubt(robot, since_s) do
    within =
      if robot.uncertainty && not String.contains?(robot[:says] || "", "±"),
        do: [Format.within(robot.uncertainty)],
        else: []

    since = if since_s, do: ["since #{Format.decimals(since_s, 1)} s"], else: []
    Enum.join(within ++ since, ", ")
  end

  @doc "The same, with how far it truly is from its place, and from where it believes to be."
  @spec figures(Scene.robot(), RunTrack.t()) :: String.t()
  def figures(robot, track) do
    parts = [
      robot.slot && "#{Format.decimals(Scene.slot_error(robot), 2)} m off its place",
      off_m(robot) && "#{Format.decimals(off_m(robot), 2)} m from where it believes to be",
      doubt(robot, RunTrack.since_s(track, robot.id))
    ]

    parts |> Enum.reject(&(&1 in [nil, ""])) |> Enum.join(", ")
  end

  @doc "How far a living robot is from where it believes to be, in metres, if that is more than 0.2; else `nil`."
  @spec off_m(Scene.robot()) :: float() | nil
  def off_m(%{alive: true, believed: %Pose{} = believed, pose: pose}) do
    off = Pose.distance(pose, believed)
    if off > @off, do: off
  end

  def off_m(_robot), do: nil
end
