defmodule Swarm.Comms.OwnHeartbeat do
  @moduledoc false
  # Makes a robot's heartbeat from its board, live and in lockstep.
  alias Robot.Board
  alias Robot.Mission.Claim
  alias Swarm.{EStop, Message}
  alias Swarm.Membership.{Heartbeat, Peers}
  alias Swarm.Message.Receiver

  @odometry_ms 300

  @doc """
  The message with the heartbeat of this number, `{boot, sequence}`. A robot without a pose yet
  has no heartbeat; one whose executive crashed stands where it was. One whose mission has decided
  nothing for a second, for example because it was frozen, does not claim to lead.
  """
  @spec message(
          Robot.Config.t(),
          Board.t() | Board.entries(),
          Receiver.t(),
          {integer(), non_neg_integer()},
          integer()
        ) ::
          {:ok, Message.t()} | :error
  def message(config, board, receiver, sender, at_ms) do
    with {:ok, pose, _then} <- Board.fetch(board, :pose, :infinity, at_ms) do
      body = %{profile: config.profile, pose: pose, odometry: odometry(board, at_ms)}
      heard = Peers.heard(receiver.peers, at_ms)
      beat = Heartbeat.new(sender, body, claim(board, at_ms), heard, EStop.written(board))
      {:ok, Message.new(config.id, :heartbeat, beat)}
    end
  end

  defp odometry(board, at_ms) do
    case Board.fetch(board, :odometry, @odometry_ms, at_ms) do
      {:ok, odometry, _then} -> odometry
      :error -> nil
    end
  end

  defp claim(board, at_ms) do
    case Board.fetch(board, :mission, :infinity, at_ms) do
      {:ok, %{state: :idle}, _at_ms} ->
        :idle

      {:ok, %{state: {mission, _phase}, claim: claim, ticked_ms: ticked_ms}, written_ms} ->
        {mission, Claim.timely(mission, claim, at_ms - (ticked_ms || written_ms))}

      :error ->
        {nil, %{}}
    end
  end
end
