defmodule Console.Live.Mesh.Frames do
  @moduledoc false
  # Decides which robots' poses are known to be in one frame, so that they can be drawn on one floor. Pure.
  #
  # A leader's pose is in the frame that it was in before and in the one that it defines, a follower's in its leader's, and
  # all others' in that of the start poses. Files that put two robots on one place cannot both be right: what is only known
  # by such a start is not known to others. Nor is the place of a robot that was started again on its way.
  alias Hal.Pose
  alias Swarm.Status
  alias Swarm.Status.Frame

  @typedoc "The number of a robot's frame, 0 for that of most, and, in the others, why it is not in that one."
  @type place :: {frame :: non_neg_integer(), apart :: String.t() | nil}

  @doc """
  The place of each of these robots. Number 0 has the leader, else the most robots, else the first.

      iex> alias Swarm.Status
      iex> frame = fn within, x -> %Status.Frame{within: within, own: 5, start: {x, 0.0}} end
      iex> mag1 = %Status{robot: :mag1, state: :lead, frame: frame.(:start, 0.0)}
      iex> mag2 = %Status{robot: :mag2, frame: frame.({:mag1, 5}, 0.0)}
      iex> min1 = %Status{robot: :min1, frame: frame.(:start, 0.0)}
      iex> Console.Live.Mesh.Frames.places([mag1, mag2, min1])
      %{
        mag1: {0, nil},
        mag2: {0, nil},
        min1: {1, "its file has it start where mag1 does, so that one of them is wrong"}
      }
      iex> Console.Live.Mesh.Frames.places([mag1, %{min1 | frame: frame.(:start, 2.0)}])
      %{mag1: {0, nil}, min1: {0, nil}}
  """
  @spec places([Status.t()]) :: %{atom() => place()}
  def places(statuses) do
    twins = twins(statuses)

    groups =
      statuses
      |> Enum.reduce([], &join(keys(&1, twins), &2))
      |> Enum.map(fn keys -> Enum.filter(statuses, &MapSet.member?(keys, own(&1))) end)
      |> Enum.sort_by(fn group ->
        {not Enum.any?(group, &leads?/1), -length(group), index(statuses, group)}
      end)

    for {group, number} <- Enum.with_index(groups), status <- group, into: %{} do
      {status.robot, {number, if(number > 0, do: why(status, twins))}}
    end
  end

  # The frames that a robot's pose is in.
  defp keys(%{frame: %Frame{within: :start}} = status, twins) do
    start = if is_map_key(twins, status.robot), do: {:start, status.robot}, else: :start
    [own(status), start]
  end

  defp keys(%{frame: %Frame{within: frame}} = status, _twins), do: [own(status), frame]
  defp keys(status, _twins), do: [own(status)]

  defp own(%{robot: id, frame: %Frame{own: own}}), do: {id, own}
  defp own(%{robot: id}), do: {id, :unknown}

  defp join(keys, sets) do
    keys = MapSet.new(keys)
    {apart, joined} = Enum.split_with(sets, &MapSet.disjoint?(&1, keys))
    [Enum.reduce(joined, keys, &MapSet.union/2) | apart]
  end

  # The robots that start where another one does.
  defp twins(statuses) do
    starts =
      for %{robot: id, frame: %Frame{start: start}} = status <- statuses,
          do: {id, start, shape(status).radius}

    for {id, start, radius} <- starts,
        {other, _, _} <- [Enum.find(starts, &(elem(&1, 0) != id and twin?(&1, start, radius)))],
        into: %{},
        do: {id, other}
  end

  # A row does not say how large a robot is.
  @unknown %{radius: 0.2, corners: []}

  @doc "The shape of a robot, as far as it is known."
  @spec shape(Status.t()) :: Status.body()
  def shape(status), do: status.body || @unknown

  defp twin?({_other, start, radius}, at, own), do: Pose.distance(at, start) < own + radius

  defp leads?(status), do: "#{status.state}" == "lead"
  defp index(statuses, [first | _]), do: Enum.find_index(statuses, &(&1.robot == first.robot))

  defp why(%{frame: nil}, _twins), do: "it does not say in which frame it is"
  defp why(%{frame: :lost}, _twins), do: "it was started again on its way, and is lost"

  defp why(%{robot: id, frame: %{within: :start}}, twins) when is_map_key(twins, id),
    do: "its file has it start where #{twins[id]} does, so that one of them is wrong"

  defp why(%{frame: %{within: {leader, _number}}}, _twins), do: "it follows #{leader}"
  defp why(_status, _twins), do: "it has met none of the others"
end
