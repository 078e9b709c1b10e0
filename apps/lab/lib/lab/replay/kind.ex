defmodule Lab.Replay.Kind do
  @moduledoc """
  Defines what a replay does, of whichever kind its recording is: of a run in lockstep (`Lab.Replay`), or of robots of
  processes (`Lab.Replay.Robots`). Pure.
  """
  alias Lab.Recording
  alias Sim.Scene

  @typedoc "A replay as it is after a tick; its module has these callbacks."
  @type t :: struct()

  @typedoc "A tick: its entries in their order, and the time at its end, in ms from the start of the recording."
  @type tick :: {at_ms :: non_neg_integer(), entries :: [term()]}

  @typedoc """
  Where a replay differs: in what a robot did on the same input (`role` and `crash` are known of robots of processes), in what
  its sensors told it, or in whether it is there. `at_ms` counts from the start of the recording.
  """
  @type difference ::
          {:decision,
           %{
             :robot => atom(),
             :at_ms => integer(),
             :input => term(),
             :recorded => [term()],
             :replayed => [term()],
             optional(:role) => atom(),
             optional(:crash) => String.t() | nil
           }}
          | {:world, %{robot: atom(), at_ms: integer(), recorded: term(), replayed: term() | nil}}
          | {:unknown, robot :: atom(), at_ms :: integer()}

  @typedoc """
  What was compared. `parts` are the counts of each role where roles are compared one by one; `world?` says whether
  the readings of the sensors were compared, too.
  """
  @type compared :: %{
          parts: [{{robot :: atom(), role :: atom()}, Record.Replay.counts()}],
          inputs: non_neg_integer(),
          decisions: non_neg_integer(),
          lost: non_neg_integer(),
          skipped: non_neg_integer(),
          world?: boolean()
        }

  @typedoc "A robot's mission, what its gate lets through, and when something was last known of it, as far as that is known."
  @type doing :: %{
          mission: module() | nil,
          driving: %{twist: Hal.Twist.t(), limits: [atom()]} | nil,
          known_ms: integer() | nil
        }

  @doc "Replays one tick, and returns where it differs, in order."
  @callback step(t(), tick()) :: {t(), [difference()]}
  @doc "Compares what is left to compare when no tick follows."
  @callback finish(t()) :: {t(), [difference()]}
  @doc "The end of the last tick, in ms from the start."
  @callback at_ms(t()) :: non_neg_integer()
  @doc "What happened to the fleet so far, oldest first."
  @callback stages(t()) :: [Scene.stage()]
  @doc "The fleet at the end of the last tick."
  @callback scene(t()) :: Scene.t()
  @doc "Why a robot decided what it decided last, with the time; `before` and `tick` are what led to this replay."
  @callback reasons(t(), before :: t(), tick(), robot :: atom()) ::
              {at_ms :: integer(), Record.Replay.Member.reasons()} | nil
  @doc "What a robot does, beside what the scene shows."
  @callback doing(t(), robot :: atom()) :: doing()
  @doc "What was compared so far."
  @callback compared(t()) :: compared()
  @doc "What a tick's entries say to people."
  @callback facts(t(), tick()) :: Recording.Facts.t()

  @doc "What robots said to each other in a tick, as far as it was recorded."
  @callback messages(t(), tick()) :: [Lab.Messages.sent()]

  @doc false
  def step(%kind{} = replay, tick), do: kind.step(replay, tick)
  @doc false
  def finish(%kind{} = replay), do: kind.finish(replay)
  @doc false
  def at_ms(%kind{} = replay), do: kind.at_ms(replay)
  @doc false
  def stages(%kind{} = replay), do: kind.stages(replay)
  @doc false
  def scene(%kind{} = replay), do: kind.scene(replay)
  @doc false
  def reasons(%kind{} = replay, before, tick, id), do: kind.reasons(replay, before, tick, id)
  @doc false
  def doing(%kind{} = replay, id), do: kind.doing(replay, id)
  @doc false
  def compared(%kind{} = replay), do: kind.compared(replay)
  @doc false
  def facts(%kind{} = replay, tick), do: kind.facts(replay, tick)
  @doc false
  def messages(%kind{} = replay, tick), do: kind.messages(replay, tick)
end
