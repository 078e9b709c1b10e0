defmodule Swarm.Status.Frame do
  @moduledoc """
  Tells in which frame a robot's pose is, as its status says: only poses of one frame tell where robots are to each
  other. Pure.

  `within` is `:start`, the frame of the start poses, in which each robot begins, or `{robot, number}`: one that this robot
  defined when it led. `own` is the number of the frame that this robot itself defines now for its followers: its
  own pose is in it as well. `start` (metres) is where it was switched on, by its file.
  """
  alias Hal.Pose
  alias Swarm.Blackboard
  alias Swarm.Wire

  @enforce_keys [:within, :own, :start]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          within: :start | {atom(), non_neg_integer()},
          own: non_neg_integer(),
          start: Pose.point()
        }

  @doc """
  The frame of a pose with this uncertainty (`t:Robot.Percept.uncertainty/0`); `:lost` of a robot that was started again
  on its way and does not know where it is, `nil` without a pose.
  """
  @spec of(Robot.Config.t(), map() | nil) :: t() | :lost | nil
  def of(_config, nil), do: nil
  def of(_config, %{lost?: true}), do: :lost

  def of(config, %{frame: frame, frame_no: own}) do
    frame =
      case frame do
        nil -> :start
        {leader, _boot, number} -> {leader, number}
      end

    %__MODULE__{within: frame, own: own, start: Pose.point(config.start)}
  end

  @doc "As it is sent in a row of the blackboard."
  @spec encode(t() | :lost) :: term()
  def encode(:lost), do: "lost"

  def encode(%__MODULE__{start: {x, y}} = frame) do
    {leader, number} = if frame.within == :start, do: {"", 0}, else: frame.within
    {to_string(leader), number, frame.own, round(x * 1000), round(y * 1000)}
  end

  @doc """
  The frame in a row; `nil` for anything else.

      iex> frame = %Swarm.Status.Frame{within: :start, own: 7, start: {1.0, 2.0}}
      iex> Swarm.Status.Frame.decode(Swarm.Status.Frame.encode(frame)) == frame
      true
      iex> {Swarm.Status.Frame.decode("lost"), Swarm.Status.Frame.decode({"", 0})}
      {:lost, nil}
  """
  @spec decode(term()) :: t() | :lost | nil
  def decode("lost"), do: :lost

  def decode({leader, number, own, x, y}) when is_binary(leader) do
    with true <- Enum.all?([number, own, x, y], &Wire.number?/1),
         {:ok, frame} <- named(leader, number) do
      %__MODULE__{within: frame, own: own, start: {x / 1000, y / 1000}}
    else
      _other -> nil
    end
  end

  def decode(_other), do: nil

  defp named("", _number), do: {:ok, :start}

  defp named(leader, number),
    do: with({:ok, name} <- Blackboard.Codec.robot(leader), do: {:ok, {name, number}})
end
