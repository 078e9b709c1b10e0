defmodule Hal.Device.Watchdog do
  @moduledoc false
  # Stops wheels that have received no further speed for 500 ms: the second line of defence behind the gate. Its message
  # `{:watchdog, ref}` counts only while `ref` is the one in the state.
  alias Hal.Device.State
  alias Hal.Twist

  @watchdog_ms 500

  @doc "Restarts the watchdog for a speed that is given now; a stop only ends it."
  @spec guard(State.t(), Twist.t()) :: State.t()
  def guard(s, twist) do
    s = unguard(s)

    if Twist.zero?(twist) do
      s
    else
      ref = make_ref()
      %{s | watchdog: {Process.send_after(self(), {:watchdog, ref}, @watchdog_ms), ref}}
    end
  end

  @doc "Ends the watchdog."
  @spec unguard(State.t()) :: State.t()
  def unguard(%{watchdog: nil} = s), do: s

  def unguard(%{watchdog: {timer, _ref}} = s) do
    Process.cancel_timer(timer)
    %{s | watchdog: nil}
  end
end
