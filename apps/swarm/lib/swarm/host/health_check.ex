defmodule Swarm.Host.HealthCheck do
  @moduledoc """
  Judges whether a robot of this node is alive by what its processes did, not by what they say:
  the gate writes to the board twenty times a second, the executive ten times, and the drive
  handles what the gate sends. It asks no process, so nothing that hangs can block it.
  """
  alias Robot.{Board, Names}

  @silent_ms 1_000
  # The gate sends 20 messages a second: this many wait if a drive hangs for 10 s. A drive that
  # opens its line may block for 5 s.
  @backlog 200

  @typedoc "The text is one line for people."
  @type t :: {well? :: boolean(), words :: String.t()}

  @doc "The pulse of a robot of this node."
  @spec of(robot :: atom()) :: t()
  def of(robot) do
    case Board.find(robot) do
      {:ok, board} -> judge(robot, ages(board), backlog(robot), offline(board) || arming(board))
      :error -> {false, "#{robot} is not there"}
    end
  end

  @doc """
  The same, judged from the age (ms) of the last work of gate and executive, `nil` for none, the
  number of messages that wait for the drive, and the arming state of the drive, or that it is
  offline.

      iex> Swarm.Host.HealthCheck.judge(:mag1, [gate: 12, executive: 80], 0, %{state: :disarmed, why: nil})
      {true, "mag1 is disarmed"}
      iex> Swarm.Host.HealthCheck.judge(:mag1, [gate: 12, executive: 80], 0, :offline)
      {true, "mag1 is there, and its drive is offline"}
      iex> Swarm.Host.HealthCheck.judge(:mag1, [gate: 2_500, executive: 80], 0, nil)
      {false, "mag1: its gate has done nothing for 2.5 s"}
  """
  @spec judge(atom(), keyword(integer() | nil), non_neg_integer() | nil, map() | :offline | nil) ::
          t()
  def judge(robot, ages, backlog, arming) do
    case Enum.find(ages, fn {_part, age_ms} -> age_ms == nil or age_ms > @silent_ms end) do
      {part, nil} ->
        {false, "#{robot}: its #{part} has done nothing yet"}

      {part, ms} ->
        {false, "#{robot}: its #{part} has done nothing for #{ms / 1_000} s"}

      nil when backlog == nil ->
        {false, "#{robot}: its drive is gone"}

      nil when backlog > @backlog ->
        {false, "#{robot}: its drive hangs, #{backlog} messages wait"}

      nil ->
        {true, "#{robot} #{words(arming)}"}
    end
  end

  defp ages(board) do
    now = Board.now(board)

    for {part, key} <- [gate: :driving, executive: :doing] do
      case Board.fetch(board, key, :infinity, now) do
        {:ok, _value, at_ms} -> {part, now - at_ms}
        :error -> {part, nil}
      end
    end
  end

  defp backlog(robot) do
    with pid when is_pid(pid) <- Names.whereis(robot, :drive),
         {:message_queue_len, length} <- Process.info(pid, :message_queue_len),
         do: length,
         else: (_gone -> nil)
  end

  defp arming(board) do
    case Board.fetch(board, :arming, :infinity) do
      {:ok, arming, _at_ms} -> arming
      :error -> nil
    end
  end

  # A line that was lost in motion is reported first.
  defp offline(board) do
    case {Board.health(board, :drive), arming(board)} do
      {_health, %{state: {:error, _reason}}} -> nil
      {{{:offline, _reason}, _since_ms}, _arming} -> :offline
      _online -> nil
    end
  end

  defp words(:offline), do: "is there, and its drive is offline"

  defp words(%{state: state, why: why}) when is_atom(state) and is_binary(why),
    do: "is #{state}: #{why}"

  defp words(%{state: state}) when is_atom(state), do: "is #{state}"
  defp words(%{state: {:error, _reason}}), do: "has lost its line, and waits to be acknowledged"
  defp words(nil), do: "waits for its drive"
end
