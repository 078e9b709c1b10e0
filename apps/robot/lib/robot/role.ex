defmodule Robot.Role do
  @moduledoc """
  A part of a robot as a pure machine: the only place where its rules stand. `Robot.Host` carries it out as a process, and
  `Swarm.Member` in lockstep. A role never calls, waits, reads a clock or sends by itself.

  | input | what arrives |
  |---|---|
  | `{:cast, message}` | what another part tells it |
  | `{:ask, from, message}` | the same, and somebody waits for `{:answer, from, result}`; `from` is `nil` in a recording |
  | `:tick` | its time has come (`c:period_ms/0`); with `c:perceive/3`, what that makes of it |

  | effect | what a host does |
  |---|---|
  | `{:drive, twist, limits}` | commands the wheels, and puts both on the board under `:driving` |
  | `{:look, pan}` | turns the camera's head (rad) |
  | `{:put, key, value}` | writes to the board, at the time of the input; a key has one writer (`Robot.Board`) |
  | `{:delete, key}` | deletes what it wrote there |
  | `{:depart, frame}` | notes that the robot has left its start pose (`Robot.Board.depart/2`) |
  | `{:latch, set?}` | sets or clears the e-stop latch |
  | `{:cast, role, message}` | hands a message to another role |
  | `{:answer, from, result}` | answers `:ask` |
  | `{:answer_saved, from}` | answers `:ask` once the latch is in its file (`Robot.Board.saved/2`) |
  | `{:apply, {m, f, a}}` | tells a part that waits for this |
  | `{:event, name, about}` | tells listeners (`Hal.Event`), with the time and the robot's name |
  | `:tick` | hands the role a tick now, before any other input |

  Effects are carried out in the order of the list. `Robot.Trace` records `:drive`, `:look` and those to other roles.
  """
  alias Hal.Twist
  alias Robot.Board

  @type input ::
          {:cast, term()}
          | {:ask, from :: GenServer.from() | nil, term()}
          | :tick
          | {:tick, Robot.Percept.t()}
  @type state :: struct()

  @type effect ::
          {:drive, Twist.t(), limits :: [atom()]}
          | {:look, pan :: float()}
          | {:put, key :: term(), value :: term()}
          | {:delete, key :: term()}
          | {:depart, Robot.Departure.frame()}
          | {:latch, boolean()}
          | {:cast, role :: atom(), message :: term()}
          | {:answer, GenServer.from() | nil, result :: term()}
          | {:answer_saved, GenServer.from() | nil}
          | {:apply, Robot.Config.call()}
          | {:event, Hal.Event.name(), map()}
          | :tick

  @doc "Its name, under which others reach it (`Robot.Names`) and which it has as a writer of the board."
  @callback name() :: atom()

  @doc "The time between two ticks."
  @callback period_ms() :: pos_integer()

  @doc "That of its process: `:high` for what must not wait for those that communicate and compute."
  @callback priority() :: :normal | :high

  @doc "The state with which it starts, also after a crash: only the board has outlived that."
  @callback init(Robot.Config.t(), Board.t() | Board.entries(), at_ms :: integer()) ::
              {state(), [effect()]}

  @doc "The input of a tick, for a role whose ticks read the board."
  @callback perceive(at_ms :: integer(), state(), Board.t()) :: input()
  @optional_callbacks perceive: 3

  @doc "Handles one input. `:unknown` is an input that it does not know, which changes nothing."
  @callback handle(input(), at_ms :: integer(), state(), Board.t() | Board.entries()) ::
              {state(), [effect()]} | :unknown
end
