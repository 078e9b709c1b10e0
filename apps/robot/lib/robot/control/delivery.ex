defmodule Robot.Control.Delivery do
  @moduledoc """
  Describes how a person's command reaches the mission that a robot runs by then, and where the reply goes.
  The requester lists the ways; the pilot, which alone knows the state of the robot, takes the
  first one that is open (`Robot.Control.Pilot.deliver/3`). Pure.

  | way | open | effect |
  |---|---|---|
  | `{:hand, {:only, module}}` | while this mission runs | it gets the command |
  | `{:hand, {:except, module}}` | while another mission runs | that mission gets the command |
  | `{:hand, {:naming, name}}` | while a mission runs that names this command for one robot among its own | that mission gets the command |
  | `{:hand, {:taking, name}}` | while a mission runs that takes commands of this name (`c:Robot.Mission.commands/0`) | that mission gets the command |
  | `:resume` | while none runs and the last stop left one | it is resumed and gets the command |
  | `{:start, module, options}` | always | it replaces a running mission and gets the command |
  """

  alias Robot.Mission

  @enforce_keys [:ways, :until_ms, :reply]
  defstruct @enforce_keys ++ [asked: nil, by: nil]

  @type way ::
          {:hand, {:only | :except, module()} | {:taking | :naming, command :: atom()}}
          | :resume
          | {:start, module(), options :: keyword()}

  @typedoc "An open way; `:hand` comes with the module of the running mission."
  @type open :: {:hand, module()} | :resume | {:start, module(), options :: keyword()}

  @typedoc """
  Why a command reached no mission: no way was open; there is no such mission; the emergency stop
  holds the robot; it was stopped after the request; it is later than `until_ms`; or, as a line, why
  the wheels may not turn (`Robot.Safety.Readiness`).
  """
  @type refusal ::
          {:error, :idle | :no_mission | :held | :stopped | :late | (line :: String.t())}

  @typedoc """
  `until_ms` is when the requester stops waiting, by the robot's clock (ms): a later command
  is refused. `asked` is the time of the request (`System.monotonic_time/1`, microseconds; `nil`
  if unknown): a request from before a stop is refused. `by` is who gave the command, for people who
  ask why; recordings of before have none. `reply` gets `:ok` or a refusal
  (`t:Robot.Role.then/0`); `nil` where none waits.
  """
  @type t :: %__MODULE__{
          ways: [way()],
          asked: integer() | nil,
          by: String.t() | nil,
          until_ms: integer(),
          reply: Robot.Role.then()
        }

  @doc """
  The first way that is open for a pilot in this state; `halted` is what the last stop left.

      iex> reply = {Kernel, :send, [self()]}
      iex> ways = [{:hand, {:except, Some.Errand}}, :resume, {:start, Some.Mission, []}]
      iex> delivery = %Robot.Control.Delivery{ways: ways, until_ms: 0, reply: reply}
      iex> Robot.Control.Delivery.way(delivery, {Some.Mission, :search}, nil)
      {:ok, {:hand, Some.Mission}}
      iex> Robot.Control.Delivery.way(delivery, :idle, {Some.Mission, :left})
      {:ok, :resume}
      iex> Robot.Control.Delivery.way(delivery, {Some.Errand, :goto}, {Some.Mission, :left})
      {:ok, {:start, Some.Mission, []}}
      iex> Robot.Control.Delivery.way(%{delivery | ways: [:resume]}, :idle, nil)
      {:error, :idle}
  """
  @spec way(t(), state :: :idle | {module(), term()}, halted :: {module(), term()} | nil) ::
          {:ok, open()} | {:error, :idle}
  def way(%__MODULE__{ways: ways}, state, halted) do
    case Enum.find_value(ways, &open(&1, state, halted)) do
      nil -> {:error, :idle}
      open -> {:ok, open}
    end
  end

  defp open({:hand, {:only, module}}, {module, _phase}, _halted), do: {:hand, module}

  defp open({:hand, {:except, other}}, {module, _phase}, _halted) when module != other,
    do: {:hand, module}

  defp open({:hand, {:taking, command}}, {module, _phase}, _halted),
    do: if(Mission.understands?(module, command), do: {:hand, module})

  defp open({:hand, {:naming, command}}, {module, _phase}, _halted),
    do: if(Mission.names?(module, command), do: {:hand, module})

  defp open(:resume, :idle, {_module, _left}), do: :resume
  defp open({:start, _module, _options} = start, _state, _halted), do: start
  defp open(_closed, _state, _halted), do: nil
end
