defmodule Swarm.Comms.OwnHeartbeatTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.Board
  alias Swarm.Comms.OwnHeartbeat
  alias Swarm.Message.Receiver

  defmodule Leading do
    @moduledoc false
    defstruct epoch: 0, formed: false
    def claims, do: {1, __MODULE__}
    def stale(claim), do: Map.merge(claim, %{phase: :agree, leader: nil, formed: false})
  end

  # A leader was frozen, or its mission hangs, while its comms process speaks.
  test "the first heartbeats after a freeze do not claim a leadership that others may have by then" do
    unless Process.whereis(Robot.Names), do: start_supervised!(Robot.Names)
    id = :"beat#{System.unique_integer([:positive])}"
    config = Robot.Case.config(id)
    start_supervised!({Board, config}, id: id)
    board = Board.find!(id)
    Board.put(board, :executive, :pose, Pose.new(0, 0), 10_000)
    claim = %{phase: :lead, leader: id, epoch: 3, formed: true, standing: true}

    entry = %{state: {Leading, :lead}, claim: claim, since_ms: 0, ticked_ms: 10_000}

    # A message that the mission heard later does not make its claim newer.
    for {written_ms, at_ms, phase} <- [
          {10_000, 10_100, :lead},
          {10_900, 11_000, :lead},
          {10_000, 11_001, :agree},
          {12_050, 12_050, :agree}
        ] do
      Board.put(board, :pilot, :mission, entry, written_ms)
      {:ok, message} = OwnHeartbeat.message(config, board, Receiver.new(id), {1, 1}, at_ms)
      beat = message.body
      %{mission: Leading, version: 1, fields: fields} = beat.claim
      assert {beat.phase, fields.epoch, beat.standing} == {phase, 3, true}

      assert {beat.leader, fields.formed} ==
               if(phase == :lead, do: {id, true}, else: {nil, false})
    end
  end
end
