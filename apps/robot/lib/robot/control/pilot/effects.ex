defmodule Robot.Control.Pilot.Effects do
  @moduledoc """
  Carries out the effects of a mission.

  | effect | goes to |
  |---|---|
  | orders: `{:goal, tag, goal}`, `{:anchors, anchors}`, `{:look, pan}` | the executive |
  | `{:send, to, message}` | the config's `:send`; dropped without one |
  | `{:claim, map}` | the board's entry `:mission` (`Robot.Control.Pilot.Journal`) |
  | `{:stage, name, map}` | the event `[:robot, :stage]` |
  """
  alias Hal.Event
  alias Robot.Control.Executive
  alias Robot.Trace
  alias Robot.Localiser.Anchors
  import Robot.Mission, only: [is_order: 1]

  @doc "Carries out one effect, and records it in the trace."
  @spec carry_out(Robot.Mission.effect(), Robot.Config.t()) :: :ok
  def carry_out(effect, config) do
    at_ms = Robot.Config.now(config)
    Trace.effect(config, :pilot, effect, at_ms)
    _ = carry_out(effect, config, at_ms)
    :ok
  end

  defp carry_out(order, config, _at_ms) when is_order(order), do: Executive.obey(config.id, order)

  defp carry_out({:send, _to, _message}, %{send: nil}, _at_ms), do: :ok

  defp carry_out({:send, to, message}, %{send: {m, f, a}}, _at_ms),
    do: apply(m, f, a ++ [to, message])

  # The runner keeps the claim.
  defp carry_out({:claim, _claim}, _config, _at_ms), do: :ok

  defp carry_out({:stage, stage, about}, config, at_ms) do
    about = Map.merge(%{robot: config.id, stage: stage}, about)
    Event.execute([:robot, :stage], %{at_ms: at_ms}, about)
  end

  @doc "Makes the executive drop the orders of a mission that has ended."
  @spec rest(Robot.Config.t()) :: :ok
  def rest(%Robot.Config{id: id}) do
    for order <- [{:goal, :idle, nil}, {:anchors, %Anchors{}}, {:look, nil}],
        do: Executive.obey(id, order)

    :ok
  end
end
