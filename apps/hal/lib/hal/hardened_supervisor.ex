defmodule Hal.HardenedSupervisor do
  @moduledoc """
  Runs the process of a module that uses `Supervisor` or `DynamicSupervisor`, which must not end because
  of a message that it does not know (`Hal.HardenedServer`).

  OTP's supervisors crash on unknown calls and casts, and log each unknown message. Here OTP's code
  supervises as usual, and only gets what it knows:

    * the requests of `Supervisor` and `DynamicSupervisor`, from processes of this node only;
    * the end of a process. An `:EXIT` that names a process of this node that is alive is forged.
  """
  alias Hal.HardenedServer

  @behaviour GenServer

  @doc "Starts the supervisor of `module`. Options: `:name`."
  @spec start_link(module(), arg :: term(), keyword()) :: Supervisor.on_start()
  def start_link(module, arg, options \\ []),
    do:
      HardenedServer.start_link(
        __MODULE__,
        {:supervisor, {self_or_name(options), module, arg}},
        options
      )

  @doc "The same for a module that uses `DynamicSupervisor`."
  @spec start_dynamic(module(), arg :: term(), keyword()) :: Supervisor.on_start()
  def start_dynamic(module, arg, options \\ []) do
    start = {module, arg, options[:name] || nil}
    HardenedServer.start_link(__MODULE__, {DynamicSupervisor, start}, options)
  end

  # As `:supervisor` names itself in its reports.
  defp self_or_name(options) do
    case options[:name] do
      nil -> :self
      name when is_atom(name) -> {:local, name}
      via -> via
    end
  end

  @impl GenServer
  def init({inner, start}) do
    case inner.init(start) do
      {:ok, state} -> {:ok, {inner, state}}
      # Newer OTPs let a supervisor hibernate once its children have started.
      {:ok, state, then} -> {:ok, {inner, state}, then}
      other -> other
    end
  end

  @impl GenServer
  def handle_call(request, {pid, _tag} = from, {inner, state} = s) do
    if node(pid) == node() and request?(inner, request),
      do: handled(inner.handle_call(request, from, state), inner),
      else: HardenedServer.drop(s)
  end

  @impl GenServer
  # From itself: OTP's code tries again to start a child that did not start.
  def handle_cast({:try_again_restart, _id} = request, {:supervisor, state}),
    do: handled(:supervisor.handle_cast(request, state), :supervisor)

  def handle_cast(_unknown, s), do: HardenedServer.drop(s)

  @impl GenServer
  def handle_info({:EXIT, pid, _reason} = message, {inner, state} = s) when is_pid(pid) do
    if node(pid) == node() and Process.alive?(pid),
      do: HardenedServer.drop(s),
      else: handled(inner.handle_info(message, state), inner)
  end

  # From itself, as above.
  def handle_info({:"$gen_restart", pid} = message, {DynamicSupervisor, state}) when is_pid(pid),
    do: handled(DynamicSupervisor.handle_info(message, state), DynamicSupervisor)

  def handle_info(_unknown, s), do: HardenedServer.drop(s)

  @impl GenServer
  def terminate(reason, {inner, state}), do: inner.terminate(reason, state)

  defp request?(_inner, request) when request in [:which_children, :count_children], do: true
  defp request?(DynamicSupervisor, {:terminate_child, pid}), do: is_pid(pid)

  defp request?(
         DynamicSupervisor,
         {:start_child, {{m, f, a}, _restart, _shutdown, _type, _modules}}
       ),
       do: is_atom(m) and is_atom(f) and is_list(a)

  defp request?(:supervisor, {what, _id_or_spec})
       when what in [
              :start_child,
              :terminate_child,
              :restart_child,
              :delete_child,
              :get_childspec
            ],
       do: true

  defp request?(_inner, _unknown), do: false

  defp handled({:noreply, state}, inner), do: {:noreply, {inner, state}}
  defp handled({:noreply, state, then}, inner), do: {:noreply, {inner, state}, then}
  defp handled({:reply, answer, state}, inner), do: {:reply, answer, {inner, state}}

  defp handled({:reply, answer, state, then}, inner),
    do: {:reply, answer, {inner, state}, then}

  defp handled({:stop, reason, state}, inner), do: {:stop, reason, {inner, state}}

  defp handled({:stop, reason, answer, state}, inner),
    do: {:stop, reason, answer, {inner, state}}
end
