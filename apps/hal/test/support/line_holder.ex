defmodule Hal.LineHolder do
  @moduledoc """
  A VM of its own that holds a serial line open and shows signs of life, to be killed or frozen.
  """
  alias Hal.Serial

  @doc "Starts the VM, which opens the line; gives it and its process id. It ends with the caller."
  @spec start(keyword()) :: {peer :: pid(), os_pid :: pos_integer()}
  def start(options) do
    paths = Enum.flat_map(:code.get_path(), &[~c"-pa", &1])
    {:ok, peer, _node} = :peer.start_link(%{connection: :standard_io, args: paths})
    :ok = :peer.call(peer, __MODULE__, :hold, [options])
    {peer, List.to_integer(:peer.call(peer, :os, :getpid, []))}
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
