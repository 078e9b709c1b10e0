defmodule Robot.Host.Phases do
  @moduledoc """
  Runs a role that has phases as a `:gen_statem` whose state is the phase (`c:Robot.Role.phase/1`): of the pilot `:idle` or
  `{mission, phase}`. So OTP's own tools show where a mission is: `:sys.get_state(pid)` is
  `{{Missions.Landmark, :follow}, data}`.
  """
  @behaviour :gen_statem
  alias Robot.{Host, Names}

  @doc "The process of a role as a child of the robot's supervisor."
  @spec child_spec({module(), Robot.Config.t()}) :: Supervisor.child_spec()
  def child_spec({role, %Robot.Config{}} = arg),
    do: %{id: role, start: {__MODULE__, :start_link, [arg]}}

  @doc "Starts the process of a role. The robot's board must be running."
  @spec start_link({module(), Robot.Config.t()}) :: :gen_statem.start_ret()
  def start_link({role, %Robot.Config{id: id}} = arg) do
    name = Names.via(id, role.name())
    :gen_statem.start_link(name, __MODULE__, arg, spawn_opt: Host.spawned(role))
  end

  @impl :gen_statem
  def callback_mode, do: :handle_event_function

  @impl :gen_statem
  def init(arg) do
    s = Host.begin(arg)
    {:ok, phase(s), s}
  end

  @impl :gen_statem
  def handle_event({:call, from}, message, _phase, s), do: next({:ask, from, message}, s)
  def handle_event(:cast, message, _phase, s), do: next({:cast, message}, s)

  # What a role knows comes as a call or a cast.
  def handle_event(:info, message, _phase, s), do: next({:info, message}, s)

  defp next(input, s) do
    s = Host.arrived(input, s)
    {:next_state, phase(s), s}
  end

  defp phase(s), do: s.role.phase(s.state)
end
