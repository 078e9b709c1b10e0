defmodule Console.Live do
  @moduledoc """
  Defines what a fleet can do that is watched and commanded while it runs.

  A view asks for the `scene/1` whenever it wants to draw, and passes on what people type as a
  command that `Console.Prompt` has checked.
  """
  alias Hal.Pose

  @type target :: :all | [atom()]
  @type command ::
          {:kill, :leader | atom()}
          | {:formation, {atom(), float() | nil}}
          | {:landmark, Pose.point() | :none}
          | {:tell, target(), Robot.Command.t() | {:replace, mission :: String.t()}}
          | :estop
          | :reset
          | {:pace, Console.Pace.command()}

  @doc "The fleet as it is now."
  @callback scene(live :: term()) :: Sim.Scene.t()

  @doc "Carries a command out; the error says in one line why not."
  @callback command(live :: term(), command()) :: {:ok, String.t()} | {:error, String.t()}

  @typedoc """
  What only some fleets can do: simulated ones kill a robot and move the landmark; real ones are armed and disarmed.
  """
  @type offer :: :kill | :landmark | :arm

  @doc "How fast it goes; `nil` for one that goes by the real clock."
  @callback pace(live :: term()) :: Console.Pace.t() | nil

  @doc "Its processes of the operating system, and how to reach them, one line each."
  @callback lines(live :: term()) :: [String.t()]

  @doc "Why the run has ended before its time, in one line; `nil` if it has not."
  @callback ended(live :: term()) :: String.t() | nil

  @doc "The result for the report, as `Lab.Trial.result/1` returns it."
  @callback result(live :: term()) :: map()

  @doc "Ends the fleet, and returns when nothing of it is left."
  @callback stop(live :: term()) :: :ok

  # What the page needs besides.

  @doc "What a person can do to it that cannot be done to every fleet."
  @callback offers(live :: term()) :: [offer()]

  @doc "What a person should know before all else, in one line, such as that no robot is heard; `nil` for nothing."
  @callback notice(live :: term()) :: String.t() | nil

  @doc "Status lines of all its robots, or of one."
  @callback status(live :: term(), :all | atom()) :: [String.t()]

  @doc "What one robot knows and does, as the page shows it (`Console.About`); `nil` if that is not known here."
  @callback about(live :: term(), atom()) :: map() | nil

  @optional_callbacks offers: 1, notice: 1, status: 2, about: 2
end
