defmodule Robot.Host.Phases do
  @moduledoc """
  Runs a role that has phases as a `:gen_statem` whose state is the phase (`c:Robot.Role.phase/1`): of the pilot `:idle` or
  `{mission, phase}`. So OTP's own tools show where a mission is: `:sys.get_state(pid)` is
  `{{Missions.Landmark, :follow}, data}`.
  """
  @behaviour :gen_statem
  alias Robot.Host

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
