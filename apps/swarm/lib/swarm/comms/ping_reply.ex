defmodule Swarm.Comms.PingReply do
  @moduledoc false
  # Words a robot's answer to `ping`: its name, how long it has been up, and its state and for how
  # long. Pure, except for `line/3`, which reads the robot's board.
  alias Robot.Board
  alias Swarm.Status

  @minute_ms 60_000

  @doc "The answer of a robot of this node with this status."
  @spec line(Robot.Config.t(), Board.t(), Status.t()) :: String.t()
  def line(config, board, %Status{} = status) do
    now_ms = Robot.Config.now(config)
    {:ok, %{since_ms: since_ms}, _at_ms} = Board.fetch(board, :mission, :infinity)
    words(status, now_ms - board.since_ms, now_ms - since_ms)
  end

  @doc """
  The same for a robot that has been up for so long, and in its state for so long (ms).

      iex> status = %Swarm.Status{robot: :mag1, node: :mag1@convoy, state: :follow}
      iex> Swarm.Comms.PingReply.words(status, 723_400, 34_000)
      "mag1 on mag1@convoy, up for 12 min 3 s, follow for 34 s"
      iex> Swarm.Comms.PingReply.words(%{status | state: :idle, arming: :disarmed}, 5_000, 5_000)
      "mag1 on mag1@convoy, up for 5 s, idle for 5 s, DISARMED"
  """
  @spec words(Status.t(), up_ms :: non_neg_integer(), state_ms :: non_neg_integer()) :: String.t()
  def words(%Status{} = status, up_ms, state_ms) do
    held = Enum.filter([status.estop && "E-STOP", Status.arming(status)], & &1)
    up = "#{status.robot} on #{status.node}, up for #{span(up_ms)}"
    Enum.join([up, "#{status.state} for #{span(state_ms)}" | held], ", ")
  end

  defp span(ms) when ms < @minute_ms, do: "#{div(ms, 1_000)} s"

  defp span(ms) when ms < 60 * @minute_ms,
    do: "#{div(ms, @minute_ms)} min #{div(rem(ms, @minute_ms), 1_000)} s"

  defp span(ms), do: "#{div(ms, 60 * @minute_ms)} h #{rem(div(ms, @minute_ms), 60)} min"
end
