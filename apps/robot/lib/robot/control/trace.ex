defmodule Robot.Control.Trace do
  @moduledoc """
  Writes down what goes into and out of the processes of a robot, so that the same inputs can be
  fed to the pure functions behind them, and the outputs compared.

  The config's `:trace` is called as `apply(m, f, a ++ [{role, kind, what, at_ms}])`, in the
  process of that role:

  | role | inputs | effects |
  |---|---|---|
  | `:gate` | `{:wish, twist}` `{:sense, reading}` `:forget` `:estop` `:reset` `:step` | `{:drive, twist, limits}` |
  | `:executive` | `{:goal, tag, goal}` `:stand` `{:anchors, anchors}` `{:look, pan}` `{:tick, raw percept}` | `{:wish, wish}` `{:look, pan}` `{:tick, percept}` `{:outcome, tag, integer}` |
  | `:pilot` | `{:start, module, options}` `:stop`, and the events of `Robot.Mission` | `{:phase, state}` and the effects of `Robot.Mission` |
  """
  alias Robot.Config

  @type entry :: {role :: atom(), :input | :effect, what :: term(), at_ms :: integer()}

  @doc "Something came in."
  @spec input(Config.t(), atom(), term(), integer()) :: :ok
  def input(config, role, what, at_ms), do: write(config.trace, {role, :input, what, at_ms})

  @doc "Something goes out."
  @spec effect(Config.t(), atom(), term(), integer()) :: :ok
  def effect(config, role, what, at_ms), do: write(config.trace, {role, :effect, what, at_ms})

  defp write(nil, _entry), do: :ok

  defp write({m, f, a}, entry) do
    apply(m, f, a ++ [entry])
    :ok
  end
end
