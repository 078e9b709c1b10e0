defmodule Sim.Emulator.RFlexController.State do
  @moduledoc false
  # Holds the state of a controller. Pure. Times are milliseconds; `counts` counts what arrived: good frames, bad frame
  # starts, unknown or lost orders, and turns with a forbidden byte 1B.
  alias Sim.Emulator.RFlexController
  alias Sim.Emulator.RFlexController.{Frame, Motors, Senses}

  @enforce_keys [:options, :booted_ms, :at_ms, :motors]
  defstruct @enforce_keys ++
              [
                id: 0,
                buffer: <<>>,
                buffer_ms: nil,
                tail: <<>>,
                off?: false,
                waiting: :queue.new(),
                next_order_ms: nil,
                motion: nil,
                inputs_wanted: nil,
                sonars: nil,
                infrared: nil,
                ranges: [],
                near: [],
                inputs: %{},
                home?: false,
                centivolts: 2_500,
                stick: {0, 0, 0},
                out: [],
                wished: nil,
                counts: %{frames: 0, bad: 0, unknown: 0, lost: 0, escaped: 0}
              ]

  @typedoc """
  `motion`, `inputs_wanted` and `infrared` are `{next_ms, period_ms, argument}` while they are
  reported.
  """
  @type t :: %__MODULE__{}

  @doc "A controller with these checked options, just switched on."
  @spec boot(map(), integer()) :: t()
  def boot(options, at_ms) do
    %__MODULE__{
      options: options,
      booted_ms: at_ms,
      at_ms: at_ms,
      motors: Motors.new(options, at_ms),
      id: options.id,
      inputs: Senses.inputs([], options)
    }
  end

  @doc "Adds a report to what will be sent."
  @spec tell(t(), RFlexController.Report.data()) :: t()
  def tell(%__MODULE__{} = core, {port, opcode, data}) do
    frame = Frame.encode({port, core.id, opcode, data}, core.options.ghost)
    %{core | id: rem(core.id + 1, 256), out: [frame | core.out]}
  end

  @doc "The time stamp of a report: milliseconds since it was switched on."
  @spec stamp(t(), integer()) :: non_neg_integer()
  def stamp(%__MODULE__{} = core, at_ms), do: max(at_ms - core.booted_ms, 0)

  @doc "Counts `n` more of something."
  @spec count(t(), atom(), non_neg_integer()) :: t()
  def count(%__MODULE__{} = core, what, n), do: update_in(core.counts[what], &(&1 + n))
end
