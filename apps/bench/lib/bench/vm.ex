defmodule Bench.Vm do
  @moduledoc """
  Further VMs to measure, with the code of this build, controlled over standard input and output,
  so that the measuring process is not part of their network. They end when this one does, frozen
  or not.
  """

  @boot_ms 60_000

  @doc "Starts one; `about` as of `:peer.start/1`, `flags` for its command line. It is up when this returns."
  @spec boot(map(), [String.t()]) :: {peer :: pid(), node()}
  def boot(about, flags) do
    arguments = Enum.map(flags ++ paths(), &to_charlist/1)
    options = %{connection: :standard_io, args: arguments, exec: command(), wait_boot: @boot_ms}
    {:ok, peer, node} = at_terminal(fn -> :peer.start(Map.merge(about, options)) end)
    {peer, node}
  end

  @doc "Sends a signal to a process of the operating system: KILL, STOP, CONT. One that is gone hears nothing."
  @spec signal(String.t(), String.t()) :: :ok
  def signal(pid, signal) do
    _gone = System.cmd("kill", ["-#{signal}", pid], stderr_to_stdout: true)
    :ok
  end

  @doc "How busy this machine was in the last minute; `nil` where nobody knows."
  @spec load() :: float() | nil
  def load do
    with {:ok, text} <- File.read("/proc/loadavg"),
         {load, _rest} <- Float.parse(text),
         do: load,
         else: (_unknown -> nil)
  end

  # What a VM prints comes to whoever started it, which must be a real device: Elixir asks that.
  defp at_terminal(start) do
    leader = Process.group_leader()
    Process.group_leader(self(), Process.whereis(:user))

    try do
      start.()
    after
      Process.group_leader(self(), leader)
    end
  end

  # The code of this build: what runs here runs there.
  defp paths, do: ["-pa" | Enum.map(:code.get_path(), &to_string/1) |> Enum.filter(&ours?/1)]

  defp ours?(path),
    do: path =~ ~r"/_build/[^/]+/(consolidated|lib/)" or path =~ ~r"/(elixir|logger)/ebin$"

  # Bound to this process where the build has the program for it.
  defp command do
    erl = System.find_executable("erl")
    leash = Application.app_dir(:sim, "priv/leash")
    if File.exists?(leash), do: {to_charlist(leash), [to_charlist(erl)]}, else: to_charlist(erl)
  end
end
