defmodule Robot.Trace do
  @moduledoc """
  Records the inputs and effects of a robot's processes, so that the same inputs can be fed to the
  pure functions behind them, and the outputs compared (`Record.Replay`).

  The config's `:trace` is called as `apply(m, f, a ++ [{role, kind, what, at_ms}])`, in the
  process of that role. The inputs (`:input`) are those of `Robot.Role`, the effects (`:effect`) those that
  `Robot.Role.recorded?/1` names.

  An entry of the kind `:begin` has the state with which a role starts, also after a crash. One of the kind `:checkpoint`
  has a function that returns that of now. It is offered between two inputs, at each tick, or, of a role without ticks, at
  each cast. A reader that wants one calls the function at once, in the process that offers it.
  """

  @roles [:gate, :executive, :pilot, :estop]

  @type kind :: :begin | :checkpoint | :input | :effect
  @type entry :: {role :: atom(), kind(), what :: term(), at_ms :: integer()}
  @type state :: Robot.Role.state()

  @doc "The roles that are recorded."
  @spec roles() :: [atom(), ...]
  def roles, do: @roles

  @doc "Records an input of the process in this role."
  @spec input(Robot.Config.t(), atom(), term(), integer()) :: :ok
  def input(config, role, what, at_ms), do: write(config.trace, {role, :input, what, at_ms})

  @doc "Records an effect of the process in this role."
  @spec effect(Robot.Config.t(), atom(), term(), integer()) :: :ok
  def effect(config, role, what, at_ms), do: write(config.trace, {role, :effect, what, at_ms})

  @doc "Records the state with which the process in this role starts, before anything else."
  @spec begin(Robot.Config.t(), atom(), state(), integer()) :: :ok
  def begin(config, role, state, at_ms), do: write(config.trace, {role, :begin, state, at_ms})

  @doc "Offers the state of the process in this role, between two inputs."
  @spec checkpoint(Robot.Config.t(), atom(), (... -> state()), integer()) :: :ok
  def checkpoint(config, role, state, at_ms),
    do: write(config.trace, {role, :checkpoint, state, at_ms})

  defp write(nil, _entry), do: :ok

  defp write({m, f, a}, entry) do
    apply(m, f, a ++ [entry])
    :ok
  end
end
