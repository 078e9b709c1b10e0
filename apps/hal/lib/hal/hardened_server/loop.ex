defmodule Hal.HardenedServer.Loop do
  @moduledoc false
  # Runs the loop of a `Hal.HardenedServer`: receives, sorts out what no callback may see, calls the module and does what
  # it answers. A process as OTP's `sys` and `proc_lib` describe special processes.
  alias Hal.HardenedServer.{Drops, Exit}

  @requests [:suspend, :resume, :get_state, :get_status]

  @doc false
  def init_it(starter, parent, name, module, arg, options) do
    Drops.name(module, name)
    debug = :gen.debug_options(name, options)
    p = %{parent: parent, name: name, module: module, state: nil, debug: debug, suspended?: false}

    # A module that raises here ends the process, and whoever started it is told why.
    case module.init(arg) do
      {:ok, state} ->
        :proc_lib.init_ack(starter, {:ok, self()})
        loop(%{p | state: state}, :infinity)

      {:ok, state, then} ->
        :proc_lib.init_ack(starter, {:ok, self()})
        wait(%{p | state: state}, then)

      {:stop, reason} ->
        exit(reason)

      :ignore ->
        :gen.unregister_name(name)
        :proc_lib.init_ack(starter, :ignore)
        exit(:normal)

      other ->
        exit({:bad_return_value, other})
    end
  end

  defp wait(p, {:continue, term}) do
    p |> call(:handle_continue, [term, p.state]) |> handled(p, {:continue, term}, nil)
  end

  defp wait(p, :hibernate), do: loop(p, :infinity)
  defp wait(p, ms), do: loop(p, ms)

  defp loop(%{suspended?: true} = p, ms) do
    receive do
      {:system, _from, _request} = message -> take(message, p, ms)
      {:EXIT, parent, _reason} = message when parent == p.parent -> take(message, p, ms)
    end
  end

  defp loop(p, ms) do
    receive do
      message -> take(message, p, ms)
    after
      ms -> info(:timeout, p)
    end
  end

  defp take({:system, {pid, _tag} = from, request}, p, ms)
       when is_pid(pid) and node(pid) == node() do
    if system?(request), do: system(request, from, p, ms), else: dropped(p, ms)
  end

  defp take({:system, _from, _request}, p, ms), do: dropped(p, ms)

  defp take({:EXIT, parent, reason} = message, %{parent: parent} = p, _ms),
    do: Exit.asked(reason, message, p)

  defp take({:"$gen_call", {pid, _tag} = from, request} = message, p, _ms) when is_pid(pid) do
    p = debug(p, {:in, message})
    p |> call(:handle_call, [request, from, p.state]) |> handled(p, message, from)
  end

  defp take({:"$gen_call", _from, _request}, p, ms), do: dropped(p, ms)

  defp take({:"$gen_cast", request} = message, p, _ms) do
    p = debug(p, {:in, message})
    p |> call(:handle_cast, [request, p.state]) |> handled(p, message, nil)
  end

  defp take(message, p, _ms), do: info(message, p)

  defp info(message, p) do
    p = debug(p, {:in, message})
    p |> call(:handle_info, [message, p.state]) |> handled(p, message, nil)
  end

  # Nothing is hidden here: whatever a callback raises ends the process with it (`Exit.crash/5`).
  defp call(p, callback, arguments) do
    {:returned, apply(p.module, callback, arguments)}
  catch
    :throw, value -> {:returned, value}
    kind, reason -> {kind, reason, __STACKTRACE__}
  end

  defp handled({:returned, {:noreply, state}}, p, _message, _from),
    do: loop(%{p | state: state}, :infinity)

  defp handled({:returned, {:noreply, state, then}}, p, _message, _from),
    do: wait(%{p | state: state}, then)

  defp handled({:returned, {:reply, answer, state}}, p, _message, {_, _} = from),
    do: p |> reply(from, answer, state) |> loop(:infinity)

  defp handled({:returned, {:reply, answer, state, then}}, p, _message, {_, _} = from),
    do: p |> reply(from, answer, state) |> wait(then)

  defp handled({:returned, {:stop, reason, state}}, p, message, _from),
    do: Exit.asked(reason, message, %{p | state: state})

  defp handled({:returned, {:stop, reason, answer, state}}, p, message, {_, _} = from),
    do: Exit.answered(reason, message, {from, answer}, %{p | state: state})

  defp handled({:returned, other}, p, message, _from),
    do: Exit.asked({:bad_return_value, other}, message, p)

  defp handled({kind, reason, stacktrace}, p, message, _from),
    do: Exit.crash(kind, reason, stacktrace, message, p)

  defp reply(p, from, answer, state) do
    GenServer.reply(from, answer)
    debug(%{p | state: state}, {:out, answer, from, state})
  end

  defp dropped(p, ms) do
    Drops.add()
    loop(p, ms)
  end

  defp system?(request) when request in @requests, do: true
  defp system?({:replace_state, function}), do: is_function(function, 1)
  defp system?({:debug, _what}), do: true
  defp system?({:terminate, _reason}), do: true
  defp system?(_unknown), do: false

  # Not by `:sys`, in whose own loop a suspended process would end because of an odd caller.
  defp system(:suspend, from, p, ms), do: answered(from, %{p | suspended?: true}, ms)
  defp system(:resume, from, p, ms), do: answered(from, %{p | suspended?: false}, ms)

  defp system(request, from, p, ms) do
    misc = {p, ms}
    :sys.handle_system_msg(request, from, p.parent, __MODULE__, p.debug, misc)
  end

  defp answered(from, p, ms) do
    GenServer.reply(from, :ok)
    loop(p, ms)
  end

  @doc false
  def system_continue(_parent, debug, {p, ms}), do: loop(%{p | debug: debug}, ms)

  @doc false
  @spec system_terminate(term(), pid(), term(), {map(), timeout()}) :: no_return()
  def system_terminate(reason, _parent, debug, {p, _ms}),
    do: Exit.asked(reason, :terminate, %{p | debug: debug})

  @doc false
  def system_get_state({p, _ms}), do: {:ok, p.state}

  @doc false
  def system_replace_state(function, {p, ms}) do
    state = function.(p.state)
    {:ok, state, {%{p | state: state}, ms}}
  end

  defp debug(%{debug: []} = p, _event), do: p

  defp debug(p, event),
    do: %{p | debug: :sys.handle_debug(p.debug, &__MODULE__.print_event/3, p.name, event)}

  @doc false
  def print_event(device, event, name),
    do: IO.puts(device, "*DBG* #{inspect(name)}: #{inspect(event)}")
end
