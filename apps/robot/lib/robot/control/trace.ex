defmodule Robot.Control.Trace do
  @moduledoc """
  Records the inputs and effects of a robot's processes, so that the same inputs can be fed to the
  pure functions behind them, and the outputs compared.

  The config's `:trace` is called as `apply(m, f, a ++ [{role, kind, what, at_ms}])`, in the
  process of that role. The inputs (`:input`) and effects (`:effect`) are

    * `:gate` - in: `{:wish, twist}`, `{:sense, reading}`, `:forget`, `:estop`, `:reset`, `:step`;
      out: `{:drive, twist, limits}`
    * `:executive` - in: `{:goal, tag, goal}`, `:stand`, `{:anchors, anchors}`, `{:look, pan}`,
      `{:tick, raw percept}`; out: `{:wish, wish}`, `{:look, pan}`, `{:tick, percept}`,
      `{:outcome, tag, integer}`
    * `:pilot` - in: `{:start, module, options}`, `:stop`, and the events of `Robot.Mission`;
      out: `{:phase, state}` and the effects of `Robot.Mission`
  """
  alias Robot.Config

  @type entry :: {role :: atom(), :input | :effect, what :: term(), at_ms :: integer()}

  @doc "Records an input of the process in this role."
  @spec input(Config.t(), atom(), term(), integer()) :: :ok
  def input(config, role, what, at_ms), do: write(config.trace, {role, :input, what, at_ms})

  @doc "Records an effect of the process in this role."
  @spec effect(Config.t(), atom(), term(), integer()) :: :ok
  def effect(config, role, what, at_ms), do: write(config.trace, {role, :effect, what, at_ms})

  defp write(nil, _entry), do: :ok

  defp write({m, f, a}, entry) do
    apply(m, f, a ++ [entry])
    :ok
  end
end
