defmodule Console.Live do
  @moduledoc """
  The behaviour of a fleet that can be watched and commanded while it runs.

  A view asks for the `scene/1` whenever it wants to draw, and passes on what people type as a
  command that `Console.Terminal.Prompt` has checked.
  """
  alias Hal.Pose

  @type target :: :all | [atom()]
  @type command ::
          {:kill, :leader | atom()}
          | {:formation, {atom(), float() | nil}}
          | {:landmark, Pose.point() | :none}
          | {:tell, target(), String.t()}
          | :estop
          | :reset
          | {:pace, Console.Live.Pace.command()}

  @doc "The fleet as it is now."
  @callback scene(live :: term()) :: Sim.Scene.t()

  @doc "Carries a command out; the error says in one line why not."
  @callback command(live :: term(), command()) :: {:ok, String.t()} | {:error, String.t()}

  @doc "How fast it goes, for people; `nil` for one that goes by the real clock."
  @callback pace(live :: term()) :: String.t() | nil

  @doc "Its processes of the operating system, and how to reach them, one line each."
  @callback lines(live :: term()) :: [String.t()]

  @doc "Why the run has ended before its time, in one line; `nil` if it has not."
  @callback ended(live :: term()) :: String.t() | nil

  @doc "The result for the report, as `Sim.Trial.result/1` returns it."
  @callback result(live :: term()) :: map()

  @doc "Ends the fleet, and returns when nothing of it is left."
  @callback stop(live :: term()) :: :ok
end
