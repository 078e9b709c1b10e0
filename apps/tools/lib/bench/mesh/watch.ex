defmodule Bench.Mesh.Watch do
  @moduledoc false
  # Records on a node when it is notified of something, by the clock that all processes of a machine share. It is queried
  # over standard input, so that queries do not use what is measured.

  @doc """
  Starts the process and calls `begin`, without an argument, in it. `see` turns a message into the
  name of what happened, or `nil`.
  """
  @spec start((... -> term()), (term() -> term() | nil)) :: :ok
  def start(begin, see) do
    stop()
    parent = self()

    pid =
      spawn(fn ->
        begin.()
        send(parent, {self(), :ready})
        loop(see, %{}, [])
      end)

    receive do: ({^pid, :ready} -> :ok)
    Process.register(pid, __MODULE__)
    :ok
  end

  @doc "Ends it, if there is one."
  @spec stop() :: :ok
  def stop do
    if pid = Process.whereis(__MODULE__) do
      monitor = Process.monitor(pid)
      Process.exit(pid, :kill)
      receive do: ({:DOWN, ^monitor, _, _, _} -> :ok)
    end

    :ok
  end

  @doc "When it was first notified of that, in ns; `nil` if that did not happen within the time."
  @spec seen(term(), timeout_ms :: pos_integer()) :: integer() | nil
  def seen(what, timeout_ms) do
    ref = make_ref()
    send(__MODULE__, {:when, what, self(), ref})

    receive do
      {^ref, at_ns} -> at_ns
    after
      timeout_ms -> nil
    end
  end

  @doc "Now, in ns, by the clock that all processes of a machine share."
  @spec now_ns() :: integer()
  def now_ns, do: :os.system_time(:nanosecond)

  # In Erlang's style, as in `Bench.Mesh.Bare`.
  @doc "Does something so many times; microseconds of each."
  @spec repeat(pos_integer(), (... -> term())) :: [float()]
  def repeat(count, fun), do: for(_ <- :lists.seq(1, count), do: timed(fun))

  defp timed(fun) do
    began = :erlang.monotonic_time(:nanosecond)
    fun.()
    (:erlang.monotonic_time(:nanosecond) - began) / 1_000
  end

  defp loop(see, seen, asked) do
    receive do
      {:when, what, pid, ref} ->
        tell(see, seen, [{what, pid, ref} | asked])

      message ->
        at_ns = now_ns()

        case see.(message) do
          nil -> loop(see, seen, asked)
          what -> tell(see, Map.put_new(seen, what, at_ns), asked)
        end
    end
  end

  defp tell(see, seen, asked) do
    {answered, asked} = Enum.split_with(asked, fn {what, _, _} -> is_map_key(seen, what) end)
    for {what, pid, ref} <- answered, do: send(pid, {ref, seen[what]})
    loop(see, seen, asked)
  end
end
