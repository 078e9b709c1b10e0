defmodule Netns.Caller do
  @moduledoc """
  Calls a node's distribution again and again, each time with another name, and hangs up when it is asked for the
  cookie: what a stranger can do who has no secret. Runs on a node of its own, where the test ships it.
  """

  @patience_ms 10_000

  @doc """
  Calls so often, with so many calls at a time. How many of them were refused before they had an answer; the others had
  one, or waited in vain.
  """
  def call(address, port, times, at_once) do
    callers =
      for n <- 1..at_once do
        share = div(times, at_once) + if(n <= rem(times, at_once), do: 1, else: 0)

        {_pid, monitor} =
          spawn_monitor(fn -> exit({:refused, calls(address, port, share, 0)}) end)

        monitor
      end

    Enum.sum(
      for monitor <- callers do
        receive do
          {:DOWN, ^monitor, _, _, {:refused, refused}} -> refused
        end
      end
    )
  end

  defp calls(_address, _port, 0, refused), do: refused

  defp calls(address, port, left, refused) do
    case call(address, port) do
      :refused -> calls(address, port, left - 1, refused + 1)
      _answered -> calls(address, port, left - 1, refused)
    end
  end

  @doc "Calls once: `:refused`, `:answered` or `:silence`."
  def call(address, port) do
    options = [:binary, packet: 2, active: false, linger: {true, 0}]

    case :gen_tcp.connect(address, port, options, @patience_ms) do
      {:ok, socket} ->
        answer = ask(socket)
        :gen_tcp.close(socket)
        answer

      {:error, :timeout} ->
        :silence

      {:error, _reset} ->
        :refused
    end
  end

  # The first message of the handshake: flags, creation, name.
  defp ask(socket) do
    name = "x#{Base.encode16(:rand.bytes(12))}@nowhere"
    hello = <<?N, 0x0D07F7FBD::64, 1::32, byte_size(name)::16, name::binary>>

    with :ok <- :gen_tcp.send(socket, hello),
         {:ok, _status} <- :gen_tcp.recv(socket, 0, @patience_ms) do
      :answered
    else
      {:error, :timeout} -> :silence
      {:error, _closed} -> :refused
    end
  end
end
