defmodule Sim.HeardController do
  @moduledoc "An emulated base that remembers which speeds its line brought it, and when."
  @behaviour Sim.Emulator.Core
  alias Sim.Emulator.RFlexController
  alias Sim.Emulator.RFlexController.Frame

  @enforce_keys [:base]
  defstruct @enforce_keys ++ [bytes: <<>>, heard: []]

  @doc "The speeds other than zero that came since then, as times (ms), newest first."
  def moves(core, since_ms) do
    for {at_ms, speed} <- core.heard, at_ms >= since_ms, speed != 0, do: at_ms
  end

  @doc "Whether the newest speed of both axes was a stop, or none came yet."
  def stopped?(core), do: not match?([{_at_ms, speed} | _] when speed != 0, core.heard)

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, base} <- RFlexController.new([ghost: :off] ++ options, at_ms),
         do: {:ok, %__MODULE__{base: base}}
  end

  @impl Sim.Emulator.Core
  def hear(core, bytes, at_ms) do
    {frames, rest, _bad} = Frame.cut(core.bytes <> bytes)

    heard =
      for {2, _id, 7, <<axis, speed::32, _rest::binary>>} <- frames,
          axis in [0, 1],
          do: {at_ms, speed}

    core = %{core | bytes: rest, heard: Enum.reverse(heard) ++ core.heard}
    %{core | base: RFlexController.hear(core.base, bytes, at_ms)}
  end

  @impl Sim.Emulator.Core
  def feel(core, reading, at_ms),
    do: %{core | base: RFlexController.feel(core.base, reading, at_ms)}

  @impl Sim.Emulator.Core
  def run(core, at_ms) do
    {bytes, wishes, base} = RFlexController.run(core.base, at_ms)
    {bytes, wishes, %{core | base: base}}
  end

  @impl Sim.Emulator.Core
  def next_ms(core), do: RFlexController.next_ms(core.base)

  @impl Sim.Emulator.Core
  def restart(core, at_ms), do: %{core | base: RFlexController.restart(core.base, at_ms)}
end
