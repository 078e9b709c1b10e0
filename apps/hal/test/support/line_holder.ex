defmodule Hal.LineHolder do
  @moduledoc """
  A VM of its own that holds a serial line open and shows signs of life, to be killed or frozen.
  """
  alias Hal.Serial

  @doc "Starts the VM, which opens the line. It ends with the caller."
  @spec start(keyword()) :: Vm.t()
  def start(options) do
    vm = Vm.start_one()
    :ok = Vm.call(vm, __MODULE__, :hold, [options])
    vm
  end

  @doc "In that VM: opens the line in a process that says that it is well every 20 ms, and answers `?` by `!`."
  @spec hold(keyword()) :: :ok
  def hold(options) do
    me = self()

    spawn(fn ->
      {:ok, line} = Serial.open(options)
      send(me, :open)
      well(line)
    end)

    receive do
      :open -> :ok
    end
  end

  defp well(line) do
    :ok = Serial.keep_alive(line)

    receive do
      message ->
        with {:data, "?"} <- Serial.handle(line, message), do: :ok = Serial.write(line, "!")
        well(line)
    after
      20 -> well(line)
    end
  end
end
