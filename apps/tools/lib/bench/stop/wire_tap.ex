defmodule Bench.Stop.WireTap do
  @moduledoc false
  # Taps the emulated base at its end of the line (`Bench.Stop.Reader`): each speed that it receives, and each input that
  # it reports, is sent at once to the process of the option `:to`, as `{:wire, event, at_us}`.
  @behaviour Sim.Emulator.Core
  alias Bench.Stop.Reader
  alias Sim.Emulator.RFlexController

  @enforce_keys [:base, :to, :heard, :said]
  defstruct @enforce_keys

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    {to, options} = Keyword.pop!(options, :to)

    with {:ok, base} <- RFlexController.new(options, at_ms),
         do: {:ok, %__MODULE__{base: base, to: to, heard: Reader.new(), said: Reader.new()}}
  end

  @impl Sim.Emulator.Core
  def hear(tap, bytes, at_ms) do
    at_us = now_us()
    {events, heard} = Reader.feed(tap.heard, bytes)
    tell(tap, events, at_us)
    %{tap | heard: heard, base: RFlexController.hear(tap.base, bytes, at_ms)}
  end

  @impl Sim.Emulator.Core
  def feel(tap, reading, at_ms),
    do: %{tap | base: RFlexController.feel(tap.base, reading, at_ms)}

  @impl Sim.Emulator.Core
  def run(tap, at_ms) do
    {bytes, wishes, base} = RFlexController.run(tap.base, at_ms)
    {events, said} = Reader.feed(tap.said, IO.iodata_to_binary(bytes))
    tell(tap, events, now_us())
    {bytes, wishes, %{tap | base: base, said: said}}
  end

  @impl Sim.Emulator.Core
  def next_ms(tap), do: RFlexController.next_ms(tap.base)

  @impl Sim.Emulator.Core
  def restart(tap, at_ms), do: %{tap | base: RFlexController.restart(tap.base, at_ms)}

  @doc "Now, in us, by the clock that all processes of a machine share."
  @spec now_us() :: integer()
  def now_us, do: :os.system_time(:microsecond)

  defp tell(tap, events, at_us), do: for(event <- events, do: send(tap.to, {:wire, event, at_us}))
end
