defmodule Robot.Control.Pilot.Effects do
  @moduledoc """
  Carries out the effects of a mission (`Robot.Mission.Runner.actions/1`).

  | effect | goes to |
  |---|---|
  | orders: `{:goal, tag, goal}`, `{:anchors, anchors}`, `{:look, pan}` | the executive |
  | `{:send, to, message}` | the config's `:send`; dropped without one |
  | `{:claim, map}` | the board's entry `:mission` (`Robot.Control.Pilot.Journal`) |
  | `{:stage, name, map}` | the event `[:robot, :stage]` |
  """
  alias Hal.Event
  alias Robot.Control.Executive
  alias Robot.Localiser.Anchors
  alias Robot.Mission.Runner
  alias Robot.Trace

  @doc "Carries out one effect, and records it in the trace."
  @spec carry_out(Robot.Mission.effect(), Robot.Config.t()) :: :ok
  def carry_out(effect, config) do
    at_ms = Robot.Config.now(config)
    Trace.effect(config, :pilot, effect, at_ms)
    Enum.each(Runner.actions(effect), &carry_out(&1, config, at_ms))
  end

  defp carry_out({:obey, order}, config, _at_ms), do: Executive.obey(config.id, order)

  defp carry_out({:send, _to, _message}, %{send: nil}, _at_ms), do: :ok

  defp carry_out({:send, to, message}, %{send: {m, f, a}}, _at_ms),
    do: apply(m, f, a ++ [to, message])

  defp carry_out({:stage, stage, about}, config, at_ms) do
    about = Map.merge(%{robot: config.id, stage: stage}, about)
    Event.execute([:robot, :stage], %{at_ms: at_ms}, about)
  end

  @doc "Makes the executive drop the orders of a mission that has ended."
  @spec drop_orders(Robot.Config.t()) :: :ok
  def drop_orders(%Robot.Config{id: id}) do
    for order <- dropped(), do: Executive.obey(id, order)
    :ok
  end

  @doc "The orders that do it."
  @spec dropped() :: [Robot.Mission.order()]
  def dropped, do: [{:goal, :idle, nil}, {:anchors, %Anchors{}}, {:look, nil}]
end
