defmodule Bench.Bases do
  @moduledoc """
  Lists what `mix bench bases` measures: what the wheels of each kind of base do when what commands it dies while it drives. Pure.
  """
  alias Hal.Cli.Parse

  @type base :: %{
          name: atom(),
          says: String.t(),
          driver: {module(), keyword()},
          core: {module(), keyword()}
        }
  @type case :: %{name: atom(), says: String.t()}

  @doc "The bases, each with its driver and its emulator."
  @spec bases() :: [base()]
  def bases do
    [
      %{
        name: :rflex,
        says: "rFLEX",
        driver: {Hal.RFlex.Driver, conversions: [distance: 31_387, angle: 4654.2, range: 1474]},
        core: {Sim.Emulator.RFlexController, []}
      },
      %{
        name: :kobuki,
        says: "Kobuki",
        driver: {Hal.Kobuki.Driver, []},
        core: {Sim.Emulator.Kobuki, []}
      },
      %{
        name: :turtlebot3,
        says: "TurtleBot3",
        driver: {Hal.TurtleBot3.Driver, calibrate: false},
        core: {Sim.Emulator.TurtleBot3, []}
      },
      %{
        name: :create,
        says: "Create 2",
        driver: {Hal.Create.Driver, []},
        core: {Sim.Emulator.Create, []}
      },
      %{
        name: :arduino,
        says: "Arduino",
        driver: {Hal.Arduino.Driver, ticks: 1_440, wheel_radius: 0.033, wheel_base: 0.2},
        core: {Sim.Emulator.Arduino, []}
      }
    ]
  end

  @doc "The causes."
  @spec cases() :: [case()]
  def cases do
    [
      %{name: :stop, says: "a stop, to compare"},
      %{name: :silence, says: "no further order"},
      %{name: :kill, says: "the VM is killed (-9)"},
      %{name: :freeze, says: "the VM is frozen (SIGSTOP)"},
      %{name: :program, says: "its port program is killed (-9)"},
      %{name: :both, says: "both are killed (-9)"},
      %{name: :pull, says: "the cable is pulled"}
    ]
  end

  @doc """
  Bases by name, in the order of the table.

      iex> {:ok, bases} = Bench.Bases.choose("kobuki")
      iex> Enum.map(bases, & &1.name)
      [:kobuki]
  """
  @spec choose(String.t()) :: {:ok, [base()]} | {:error, String.t()}
  def choose(text), do: Parse.named(text, bases())
end
