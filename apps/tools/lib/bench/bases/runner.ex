defmodule Bench.Bases.Runner do
  @moduledoc false
  # Measures a base and a cause: an emulated base here, its driver in a VM of its own. The time runs from before the cause until
  # the base's wheels stand.
  alias Bench.Bases.Holder
  alias Sim.Emulator

  @speed 0.2
  @stands 0.001
  # Longer than any time-out of the firmwares.
  @longest_ms 5_000
  @start_ms 20_000
  @look_ms 1

  @doc "How long the wheels turned on (ms), each of so many times; `nil` for longer than 5 s."
  @spec run(Bench.Bases.base(), atom(), pos_integer(), Path.t()) :: [non_neg_integer() | nil]
  def run(base, cause, times, folder) do
    for n <- 1..times, do: once(base, cause, Path.join(folder, "#{base.name}-#{cause}-#{n}"))
  end

  defp once(base, cause, link) do
    {:ok, emulator} = Emulator.start_link(core: base.core, link: link)
    vm = Vm.start_one()

    try do
      :ok = Vm.call(vm, Holder, :main, [base.driver, link, @speed])
      true = within?(@start_ms, fn -> Emulator.wheels(emulator).linear > 0.95 * @speed end)
      # The times of causes and of the driver's ticks should not be those of its start.
      within?(:rand.uniform(100), fn -> false end)
      :ok = Vm.call(vm, Holder, :arm_no_more, [])
      prepared = prepare(cause, vm)
      since_ms = Hal.Clock.now_ms()
      :ok = happen(cause, vm, emulator, prepared)
      if within?(@longest_ms, fn -> stands?(emulator) end), do: Hal.Clock.now_ms() - since_ms
    after
      Vm.signal(vm, "KILL")
      GenServer.stop(emulator)
    end
  end

  defp prepare(cause, vm) when cause in [:program, :both], do: Vm.call(vm, Holder, :programs, [])
  defp prepare(_cause, _vm), do: []

  defp happen(:stop, vm, _emulator, _), do: Vm.call(vm, Holder, :order, [0.0])
  defp happen(:silence, vm, _emulator, _), do: Vm.call(vm, Holder, :order, [nil])
  defp happen(:kill, vm, _emulator, _), do: Vm.signal(vm, "KILL")
  defp happen(:freeze, vm, _emulator, _), do: Vm.signal(vm, "STOP")
  defp happen(:program, _vm, _emulator, [pid]), do: Vm.signal(pid, "KILL")

  # The program first: it would say the last words.
  defp happen(:both, vm, _emulator, [pid]) do
    {_out, 0} = System.cmd("kill", ["-KILL", pid, vm.pid])
    :ok
  end

  defp happen(:pull, _vm, emulator, _), do: Emulator.unplug(emulator)

  defp stands?(emulator) do
    wheels = Emulator.wheels(emulator)
    abs(wheels.linear) < @stands and abs(wheels.turn) < @stands
  end

  defp within?(ms, condition), do: until?(Hal.Clock.now_ms() + ms, condition)

  defp until?(until_ms, condition) do
    cond do
      condition.() -> true
      Hal.Clock.now_ms() >= until_ms -> false
      true -> receive(do: (:never -> :ok), after: (@look_ms -> until?(until_ms, condition)))
    end
  end
end
