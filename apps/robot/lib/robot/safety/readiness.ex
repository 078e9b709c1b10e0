defmodule Robot.Safety.Readiness do
  @moduledoc """
  Decides whether an order that can move a robot would be carried out now, and whether a stop
  reaches its wheels, by the drive's entries on the board. An order is for now: it must not begin
  to move the robot later, when it is armed, no matter by what: a person, or, with `arm: :auto`, the
  drive itself. In a dry run nothing moves, and every order is accepted.
  """
  alias Hal.Device.Explanation
  alias Robot.Board

  @typedoc "The board's entries `:arming` and `{:health, :drive}`; `nil` if there is none yet."
  @type arming :: %{state: Hal.Device.Arming.state(), why: String.t() | nil} | nil
  @type health :: :online | {:offline, reason :: term()} | nil

  @doc "Judges a robot of this node by its config and its board (`judge/2`)."
  @spec of(
          %{:dry_run => boolean(), :drive => term(), optional(atom()) => term()},
          Board.t() | Board.entries()
        ) ::
          :ok | {:error, line :: String.t()}
  def of(%{dry_run: true}, _board), do: :ok

  def of(%{dry_run: false, drive: drive}, board) do
    case entry(board, {:health, :drive}) do
      # It is told again and again; an order may turn them.
      {:offline, {:stands, :wheels}} ->
        judge(entry(board, :arming), nil)

      {:offline, reason} ->
        judge(entry(board, :arming), {:offline, Explanation.offline(drive, reason)})

      health ->
        judge(entry(board, :arming), health)
    end
  end

  @doc """
  The same of the wheels alone: a drive that is armed and has gone offline because it does not obey
  is told again and again, until it does.
  """
  @spec armed(%{:dry_run => boolean(), optional(atom()) => term()}, Board.t() | Board.entries()) ::
          :ok | {:error, line :: String.t()}
  def armed(%{dry_run: true}, _board), do: :ok
  def armed(%{dry_run: false}, board), do: judge(entry(board, :arming), nil)

  @doc """
  `:ok`, or the reason as a line that does not name the robot. If the reason why the drive is
  offline is a text, it is used unchanged.

      iex> Robot.Safety.Readiness.judge(%{state: :armed, why: nil}, :online)
      :ok
      iex> Robot.Safety.Readiness.judge(%{state: :disarmed, why: nil}, :online)
      {:error, "its wheels are disarmed; arm it first"}
      iex> Robot.Safety.Readiness.judge(%{state: :disarmed, why: "conversion distance is missing"}, :online)
      {:error, "its wheels are disarmed (conversion distance is missing)"}
      iex> Robot.Safety.Readiness.judge(%{state: :disarmed, why: nil}, {:offline, :enoent})
      {:error, "its drive is offline (:enoent)"}
      iex> Robot.Safety.Readiness.judge(%{state: {:error, :eio}, why: nil}, :online)
      {:error, "its line was lost (:eio) while the wheels turned; look, acknowledge, and arm it"}
      iex> Robot.Safety.Readiness.judge(nil, nil)
      {:error, "its drive is not open yet"}
  """
  @spec judge(arming(), health()) :: :ok | {:error, line :: String.t()}
  def judge(%{state: {:error, reason}}, _health),
    do:
      {:error,
       "its line was lost (#{brief(reason)}) while the wheels turned; look, acknowledge, and arm it"}

  def judge(_arming, {:offline, reason}),
    do: {:error, "its drive is offline (#{brief(reason)})"}

  def judge(%{state: :armed}, _health), do: :ok

  def judge(%{state: :disarmed, why: nil}, _health),
    do: {:error, "its wheels are disarmed; arm it first"}

  def judge(%{state: :disarmed, why: why}, _health),
    do: {:error, "its wheels are disarmed (#{why})"}

  def judge(nil, _health), do: {:error, "its drive is not open yet"}

  @doc """
  Whether a stop that the gate has carried out can have reached the wheels. It cannot if the
  connection to them was lost while they turned and is not back; the error says so. When the
  connection is opened again, it begins with a stop.
  """
  @spec stopped(Board.t()) :: :ok | {:error, line :: String.t()}
  def stopped(board), do: reached(entry(board, :arming), entry(board, {:health, :drive}))

  @doc """
  The same, from the entries of the board.

      iex> Robot.Safety.Readiness.reached(%{state: {:error, :unplugged}, why: nil}, {:offline, :unplugged})
      {:error,
       "its line was lost (:unplugged) while the wheels turned, and is not back: its gate stands, but nobody can " <>
         "say anything to the wheels; use the robot's own emergency stop"}
      iex> Robot.Safety.Readiness.reached(%{state: {:error, :unplugged}, why: nil}, :online)
      :ok
      iex> Robot.Safety.Readiness.reached(%{state: :disarmed, why: nil}, {:offline, :enoent})
      :ok
  """
  @spec reached(arming(), health()) :: :ok | {:error, line :: String.t()}
  def reached(%{state: {:error, reason}}, {:offline, _since}) do
    {:error,
     "its line was lost (#{brief(reason)}) while the wheels turned, and is not back: its gate stands, but " <>
       "nobody can say anything to the wheels; use the robot's own emergency stop"}
  end

  def reached(_arming, _health), do: :ok

  defp brief(words) when is_binary(words), do: words
  defp brief(reason), do: inspect(reason, limit: 5, printable_limit: 40)

  defp entry(board, key) do
    case Board.fetch(board, key, :infinity, 0) do
      {:ok, value, _at_ms} -> value
      :error -> nil
    end
  end
end
