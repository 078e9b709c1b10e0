defmodule Bench.Stop do
  @moduledoc """
  Lists what `mix bench stop` measures: the time from a fault on a robot that drives at full speed until
  the stop arrives at the other end of its serial line. Pure.

  The stop has arrived when both axes of the base were told a speed of zero. What the base does
  then (it brakes) is not measured.
  """
  alias Hal.Cli.Parse

  @type name :: :crash | :frozen | :kill | :freeze | :pull | :estop | :bumper
  @type case :: %{name: name(), says: String.t(), goal_ms: pos_integer() | nil}

  @goal_ms 300
  @urgent_ms 50

  @doc "All cases. A line that is pulled has no goal, because nothing can be sent on it."
  @spec cases() :: [case()]
  def cases do
    [
      %{name: :crash, says: "a behaviour raises", goal_ms: @goal_ms},
      %{name: :frozen, says: "the executive is frozen", goal_ms: @goal_ms},
      %{name: :kill, says: "the VM is killed (-9)", goal_ms: @goal_ms},
      %{name: :freeze, says: "the VM is frozen (SIGSTOP)", goal_ms: @goal_ms},
      %{name: :estop, says: "emergency stop", goal_ms: @urgent_ms},
      %{name: :bumper, says: "a bumper's report", goal_ms: @urgent_ms},
      %{name: :pull, says: "the line was pulled: from plugging it in again", goal_ms: nil}
    ]
  end

  @doc """
  Cases by name, in the order of the table.

      iex> {:ok, cases} = Bench.Stop.choose("estop,crash")
      iex> Enum.map(cases, & &1.name)
      [:crash, :estop]
      iex> Bench.Stop.choose("brake") |> elem(0)
      :error
  """
  @spec choose(String.t()) :: {:ok, [case()]} | {:error, String.t()}
  def choose(text), do: Parse.named(text, cases())
end
