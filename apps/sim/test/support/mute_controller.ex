defmodule Sim.MuteController do
  @moduledoc """
  An emulated base that hears and obeys, but sends only what a test lets it: reports of the ports
  in `silent` are not sent (`:all`: none). Ports are those of the fact sheet: 2 wheels, 4 sonars.
  """
  @behaviour Sim.Emulator.Core
  alias Sim.Emulator.RFlexController
  alias Sim.Emulator.RFlexController.Frame

  @enforce_keys [:base, :silent]
  defstruct @enforce_keys ++ [pressed: []]

  @doc "From now on sends nothing from these ports."
  def silence(core, silent), do: %{core | silent: silent}

  @doc "From now on these bumpers are pressed, whatever the body senses."
  def hold(core, pressed), do: %{core | pressed: pressed}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    {silent, options} = Keyword.pop(options, :silent, [])

    with {:ok, base} <- RFlexController.new([ghost: :off] ++ options, at_ms),
         do: {:ok, %__MODULE__{base: base, silent: silent}}
  end

  @impl Sim.Emulator.Core
  def hear(core, bytes, at_ms), do: %{core | base: RFlexController.hear(core.base, bytes, at_ms)}

  @impl Sim.Emulator.Core
  def feel(core, {:bumpers, felt}, at_ms) do
    pressed = Enum.uniq(core.pressed ++ felt)
    %{core | base: RFlexController.feel(core.base, {:bumpers, pressed}, at_ms)}
  end

  def feel(core, reading, at_ms),
    do: %{core | base: RFlexController.feel(core.base, reading, at_ms)}

  @impl Sim.Emulator.Core
  def run(core, at_ms) do
    {bytes, wishes, base} = RFlexController.run(core.base, at_ms)
    {frames, "", 0} = bytes |> IO.iodata_to_binary() |> Frame.cut()
    said = for frame <- frames, says?(core.silent, elem(frame, 0)), do: Frame.encode(frame, :off)
    {IO.iodata_to_binary(said), wishes, %{core | base: base}}
  end

  defp says?(:all, _port), do: false
  defp says?(silent, port), do: port not in silent

  @impl Sim.Emulator.Core
  def next_ms(core), do: RFlexController.next_ms(core.base)

  @impl Sim.Emulator.Core
  def restart(core, at_ms), do: %{core | base: RFlexController.restart(core.base, at_ms)}
end
