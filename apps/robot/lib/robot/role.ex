defmodule Robot.Role do
  @moduledoc """
  A part of a robot as a pure machine: the only place where its rules stand. `Robot.Host` carries it out as a process, and
  `Robot.Lockstep` in simulation. A role never calls, waits, reads a clock or sends by itself.

  | input | what arrives |
  |---|---|
  | `{:cast, message}` | what another part tells it |
  | `{:ask, from, message}` | the same, and a caller waits for `{:answer, from, result}`; `from` is `nil` in a recording |
  | `:tick` | its time has come (`c:period_ms/0`); with `c:perceive/3`, `{:tick, what that sees}` |
  | `{:info, message}` | whatever else reaches its process, which no role knows |

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
  | `{:apply, then}`, `{:apply, then, more}` | tells a part that waits for this (`t:then/0`); a role gets `{:result, message, result}` |
  | `{:reply, ref, answer}` | answers a person's order or question with this alias; `nil` where none waits |
  | `{:after, ms, message}` | hands the role this message as a cast, so much later |
  | `{:disarm, then}` | disarms the wheels, and tells a part that waits for this |
  | `{:send, to, message}` | hands the role `:comms` a message to other robots, as `{:cast, :comms, {:say, to, message}}` |
  | `{:transmit, to, message}` | hands the transport such a message (`Robot.Config`) |
  | `{:stage, name, about}` | tells people a stage of the mission (event `[:robot, :stage]`) |
  | `{:phase, state}` | tells that the mission came to this state (event `[:robot, :pilot, :phase]`) |
  | `{:claim, claim}` | nothing: the claim is on the board; a recording shows it |
  | `{:event, name, about}` | tells listeners (`Hal.Event`), with the time and the robot's name |
  | `:tick` | hands the role a tick now, before any other input |

  Effects are carried out in the order of the list. `Robot.Trace` records those that others notice (`recorded?/1`).
  """
  alias Hal.Twist
  alias Robot.Board

  @type input ::
          {:cast, term()}
          | {:ask, from :: GenServer.from() | nil, term()}
          | :tick
          | {:tick, seen :: Robot.Percept.t() | map()}
          | {:info, term()}
  @type state :: struct()

  @typedoc "What waits for a role: `{m, f, a}`, a role with its message, nothing, or what a recording has in place of these."
  @type then :: Robot.Config.call() | {:cast, role :: atom(), message :: term()} | nil | :recorded

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
          | {:apply, then()}
          | {:apply, then(), more :: [term()]}
          | {:reply, reference() | nil, answer :: term()}
          | {:after, ms :: pos_integer(), message :: term()}
          | {:disarm, then()}
          | {:send, to :: atom() | [atom()] | :all, struct()}
          | {:transmit, to :: [atom()] | :all, struct()}
          | {:stage, atom(), map()}
          | {:phase, :idle | {module(), atom()}}
          | {:claim, map()}
          | {:event, Hal.Event.name(), map()}
          | :tick

  @doc "Its name, under which others reach it (`Robot.Names`) and which it has as a writer of the board."
  @callback name() :: atom()

  @doc "The time between two ticks; `nil` for a role that has none."
  @callback period_ms() :: pos_integer() | nil

  @doc "That of its process: `:high` for what must not wait for those that communicate and compute."
  @callback priority() :: :normal | :high

  @doc "The state with which it starts, also after a crash: only the board has outlived that."
  @callback init(Robot.Config.t(), Board.t() | Board.entries(), at_ms :: integer()) ::
              {state(), [effect()]}

  @doc "The input of a tick, for a role whose ticks read the board."
  @callback perceive(at_ms :: integer(), state(), Board.t()) :: input()

  @doc """
  An input as the role handles it, with what only a process knows: `now_us` is `System.monotonic_time/1` in microseconds, by
  which people's orders are dated. `:unknown` is one that looks like an input and is not whole.
  """
  @callback arrive(input(), now_us :: integer(), Board.t() | Board.entries()) ::
              input() | :unknown

  @doc "The module of others whose code runs on this input, so that one that hangs is found and named."
  @callback foreign(input(), state()) :: module() | nil
  @doc "The phase that it is in, for a role that has phases: its process shows it (`Robot.Host.Phases`)."
  @callback phase(state()) :: term()
  @doc """
  Whether a cast that waits may be dropped, for a role to which strangers send: its mailbox is kept short under a flood
  (`Robot.Host.LoadShedder`), and it is told how many messages were dropped, as `{:cast, {:rejected, :flooded, count}}`.
  """
  @callback expendable?(message :: term()) :: boolean()
  @optional_callbacks perceive: 3, foreign: 2, arrive: 3, phase: 1, expendable?: 1

  @doc "Handles one input. `:unknown` is an input that it does not know, which changes nothing."
  @callback handle(input(), at_ms :: integer(), state(), Board.t() | Board.entries()) ::
              {state(), [effect()]} | :unknown

  @doc "Whether an effect is recorded: what other roles, robots, devices and people notice."
  @spec recorded?(effect()) :: boolean()
  def recorded?(effect),
    do: elem_or_self(effect) in [:drive, :look, :cast, :send, :stage, :phase, :claim, :disarm]

  defp elem_or_self(effect) when is_tuple(effect), do: elem(effect, 0)
  defp elem_or_self(effect), do: effect

  @doc """
  An input or an effect as a recording holds it: without those that wait, which are processes of that run.

      iex> Robot.Role.recorded({:cast, {:halt, 1, {Kernel, :send, [self(), :done]}}})
      {:cast, {:halt, 1, :recorded}}
      iex> Robot.Role.recorded({:ask, {self(), make_ref()}, :reset})
      {:ask, nil, :reset}
  """
  @spec recorded(input() | effect()) :: input() | effect()
  def recorded({:ask, _from, message}), do: {:ask, nil, message}
  def recorded({:cast, role, message}), do: {:cast, role, plain(message)}
  def recorded({:cast, message}), do: {:cast, plain(message)}
  def recorded({:disarm, _then}), do: {:disarm, :recorded}
  def recorded(other), do: other

  defp plain({kind, _then}) when kind in [:forget, :latch], do: {kind, :recorded}

  defp plain({kind, token, _then}) when kind in [:stand, :halt],
    do: {kind, token, :recorded}

  defp plain({:confirm, _then, result}), do: {:confirm, :recorded, result}
  defp plain({:deliver, delivery, event}), do: {:deliver, %{delivery | reply: :recorded}, event}
  defp plain(message), do: message
end
