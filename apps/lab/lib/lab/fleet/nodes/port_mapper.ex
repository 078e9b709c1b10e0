defmodule Lab.Fleet.Nodes.PortMapper do
  @moduledoc false
  # Provides Erlang's port mapper (epmd) for the duration of a run: if none answers, one is started, which ends with the
  # run in any case. An existing one is left alone, and so is ours while others use it.

  @host "127.0.0.1"
  @address {127, 0, 0, 1}
  @up_ms 2_000
  @down_ms 3_000
  # It reads until it is told to end, or until the VM has ended in any way. An epmd with
  # registered names does not end: the names of our own nodes disappear in a moment; if others
  # remain, so does the epmd.
  @keeper """
  trap '' INT TERM HUP
  read -r _told
  left=50
  until "$1" -kill >/dev/null 2>&1; do
    "$1" -names >/dev/null 2>&1 || exit 0
    left=$((left - 1))
    [ "$left" -gt 0 ] || exit 0
    sleep 0.05
  done
  """

  @typedoc "The port that ends the epmd that we started; `nil` if it is not ours."
  @type t :: port() | nil

  @doc """
  Makes sure that an epmd answers, if possible; the port that ends it belongs to the calling
  process.
  """
  @spec start() :: t()
  def start do
    program = System.find_executable("epmd") || Path.join(erts(), "epmd")

    if not there?() and File.exists?(program) do
      # A daemon does not hold our terminal. It returns before it listens.
      System.cmd(program, ["-daemon"], env: [{"ERL_EPMD_ADDRESS", @host}])
      await(Hal.Clock.now_ms() + @up_ms)
      sh = System.find_executable("sh")
      options = [:exit_status, :hide, args: ["-c", @keeper, "keeper", program]]
      Port.open({:spawn_executable, sh}, options)
    end
  end

  @doc """
  Ends the epmd if it is ours and no other node uses it. Our own node must have left it before.
  """
  @spec stop(t()) :: :ok
  def stop(nil), do: :ok

  def stop(keeper) do
    Port.command(keeper, "end\n")

    receive do
      {^keeper, {:exit_status, _status}} -> :ok
    after
      @down_ms -> :ok
    end
  end

  defp await(deadline) do
    if not there?() and Hal.Clock.now_ms() < deadline do
      receive do
      after
        20 -> await(deadline)
      end
    end
  end

  defp there? do
    case :gen_tcp.connect(@address, port(), [], 100) do
      {:ok, socket} -> :gen_tcp.close(socket) == :ok
      {:error, _none} -> false
    end
  end

  defp port do
    case Integer.parse(System.get_env("ERL_EPMD_PORT", "")) do
      {port, ""} when port in 1..65_535 -> port
      _default -> 4369
    end
  end

  defp erts, do: Path.join([:code.root_dir(), "erts-#{:erlang.system_info(:version)}", "bin"])
end
