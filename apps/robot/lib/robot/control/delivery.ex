defmodule Robot.Control.Delivery do
  @moduledoc """
  How a command of a person reaches a robot's mission, whichever that is by then, and who is told what became of it.
  The asker decides on the ways; the pilot, which alone knows what the robot is at, takes the first that is open
  (`Robot.Control.Pilot.deliver/3`). Pure.

  | way | is open | then |
  |---|---|---|
  | `{:hand, {:only, module}}` | while this mission runs | it gets the command |
  | `{:hand, {:except, module}}` | while another than this runs | it gets the command |
  | `:resume` | while none runs, and the last stop left one | it is taken up, and gets the command |
  | `{:start, module, options}` | always | this mission takes the place of a running one, and gets the command |
  """

  @enforce_keys [:ways, :until_ms, :reply]
  defstruct @enforce_keys ++ [asked: nil]

  @type way ::
          {:hand, {:only | :except, module()}}
          | :resume
          | {:start, module(), options :: keyword()}

  @typedoc "A way that is open, with the module that it leads to."
  @type open :: {:hand, module()} | :resume | {:start, module(), options :: keyword()}

  @typedoc """
  Why a command reached no mission: no way was open; there is no such mission; the emergency stop holds the robot; it
  was stopped since this was asked; it is later than `until_ms`.
  """
  @type refusal :: {:error, :idle | :no_mission | :held | :stopped | :late}

  @typedoc """
  `until_ms` is when whoever asked stops waiting (`System.monotonic_time/1`, ms): later nothing is begun. `asked` is when that was
  (`System.monotonic_time/1`, microseconds; `nil` where nobody knows): what was asked before a stop ended with it. `reply`
  is applied with `:ok` or a refusal as its last argument.
  """
  @type t :: %__MODULE__{
          ways: [way()],
          asked: integer() | nil,
          until_ms: integer(),
          reply: Robot.Config.call()
        }

  @doc """
  The first way that is open, for a pilot in this state, after a stop that left this.

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

  defp open(:resume, :idle, {_module, _left}), do: :resume
  defp open({:start, _module, _options} = start, _state, _halted), do: start
  defp open(_closed, _state, _halted), do: nil
end
