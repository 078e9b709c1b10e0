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
          | {:place, (robot :: atom()) | (object :: String.t()), Pose.point()}
          | {:program, robot :: atom(), :start | :end, name :: String.t()}
          | {:tell, target(), Robot.Command.t() | {:replace, mission :: String.t()}}
          | :estop
          | :reset
          | {:pace, Console.Pace.command()}

  @doc "The fleet as it is now."
  @callback scene(live :: term()) :: Sim.Scene.t()

  @doc "Carries a command out; the error says in one line why not."
  @callback command(live :: term(), command()) :: {:ok, String.t()} | {:error, String.t()}

  @typedoc """
  What only some fleets can do: simulated ones kill a robot, move the landmark, and put robots, balls and boxes elsewhere; real ones are armed and disarmed. A recording
  is shown at any time of its run, and takes no orders (`:replay`).
  """
  @type offer :: :kill | :landmark | :place | :arm | :replay

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

  @doc "The status of each robot that is heard, by its own word; fleets that are not of processes have none."
  @callback statuses(live :: term()) :: [Swarm.Status.t()]

  @doc "What one robot knows and does, as the page shows it (`Console.About`); `nil` if that is not known here."
  @callback about(live :: term(), atom()) :: map() | nil

  @doc """
  What robots have said to each other of late (`Lab.Messages`), up to the time that is shown; the error says in one line why that is
  not known here.
  """
  @callback messages(live :: term()) :: {:ok, [Lab.Messages.entry()]} | {:error, String.t()}

  @doc """
  Its nodes, with the robots and programs there; the error says in one line why that is not known here.
  """
  @callback nodes(live :: term()) :: {:ok, [Console.Nodes.row()]} | {:error, String.t()}

  # A recording has these, too.

  @typedoc """
  A run for a strip of time: its length, how far it is known, whether it goes on, its name and that of the one beside it, how many entries there are in all, and the
  newest of these, oldest first. `at_s` is missing from an entry that only has `stages`.
  """
  @type history :: %{
          last_s: float(),
          known_s: float(),
          playing: boolean(),
          names: [String.t()],
          count: non_neg_integer(),
          entries: [
            %{
              required(:stages) => [Sim.Scene.stage()],
              optional(:at_s) => float(),
              optional(:error) => [float()] | nil,
              optional(:leader) => atom() | nil,
              optional(:formed) => boolean(),
              optional(:held) => boolean()
            }
          ]
        }

  @doc "Carries out what a person types, where the lines of `Console.Prompt` mean nothing."
  @callback answer(live :: term(), text :: String.t()) ::
              {:ok, String.t() | [String.t()]} | {:error, String.t()}

  @doc "The run, with the entries after the first so many."
  @callback history(live :: term(), after_count :: non_neg_integer()) :: history()

  @doc "The scene of another run that is shown beside this one, at the same time; `nil` for none."
  @callback beside(live :: term()) :: Sim.Scene.t() | nil

  @optional_callbacks offers: 1,
                      notice: 1,
                      status: 2,
                      about: 2,
                      statuses: 1,
                      messages: 1,
                      nodes: 1,
                      answer: 2,
                      history: 2,
                      beside: 1
end
