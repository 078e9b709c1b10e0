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

  @doc """
  In that VM: opens the line in a process that says that it is well every 20 ms, answers `?` by `!`, and opens a line
  that it has lost anew.
  """
  @spec hold(keyword()) :: :ok
  def hold(options) do
    me = self()

    spawn(fn ->
      {:ok, line} = Serial.open(options)
      send(me, :open)
      well(line, options)
    end)

    receive do
      :open -> :ok
    end
  end

  defp well(line, options) do
    with :ok <- Serial.keep_alive(line),
         :ok <- answer(line) do
      well(line, options)
    else
      {:error, :last_words} ->
        :ok = Serial.close(line)
        {:ok, line} = Serial.open(options)
        well(line, options)
    end
  end

  defp answer(line) do
    receive do
      message ->
        case Serial.handle(line, message) do
          {:data, "?"} -> Serial.write(line, "!")
          {:error, _reason} = error -> error
          _other -> :ok
        end
    after
      20 -> :ok
    end
  end
end
