defmodule Robot.Behaviour do
  @moduledoc """
  Turns what a robot perceives into a wish, one tick (100 ms) at a time. It is pure: no clock, no process, no random
  numbers; the time is `percept.at_ms`.

  A running behaviour is a pair `{module, state}`, so that behaviours can hold, start and combine
  others (`Robot.Behaviour.Sequence`, `.Parallel`, `.Fsm`, …). It runs until it reports an
  outcome, an integer as in the thesis, by which combinators choose what comes next.
  """
  alias Hal.Options.Type
  alias Robot.{Percept, Wish}

  @type t :: {module(), state :: term()}
  @type outcome :: integer()
  @type result :: {:running, Wish.t() | nil, t()} | {:done, outcome(), Wish.t() | nil}

  @doc "Starts a behaviour with these options; wrong options raise `ArgumentError`."
  @callback new(keyword()) :: t()

  @doc "One tick."
  @callback tick(Percept.t(), state :: term()) :: result()

  @doc "The running behaviour with some options changed, such as a target that moves every tick."
  @callback update(keyword(), state :: term()) :: t()

  @typedoc "What is left of the way to a goal (metres), that walls leave none, or that the robot lets another pass first."
  @type route :: {:left, float()} | :no_way | :waits

  @doc """
  Told at each tick, after `c:tick/2`, of the way to the goal that the behaviour wished for (`Robot.Behaviour.Avoid`).
  """
  @callback routed(route(), Percept.t(), state :: term()) :: t()

  @doc "The options as a table of `Hal.Options`: with it people may write them as text, `run:corners:side=2`."
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks update: 2, routed: 3, option_table: 0

  @doc """
  Checks a goal, `{module, options}` or `nil` for none: whether the module is a behaviour that
  accepts these options.

      iex> Robot.Behaviour.check({Robot.Behaviour.Goto, x: 1.0, y: 2.0})
      :ok
      iex> Robot.Behaviour.check({NoSuchModule, []})
      {:error, "expected a behaviour, a module with new/1 and tick/2, got NoSuchModule"}
      iex> Robot.Behaviour.check({Robot.Behaviour.Goto, x: :far, y: 2.0})
      {:error, "Robot.Behaviour.Goto: goto option x: expected a number from -1.0e6 to 1.0e6 m, got :far"}
      iex> Robot.Behaviour.check({Robot.Behaviour.Goto, x: 1.0, y: 2.0, discs: :junk})
      {:error, "option discs: expected [{x, y, radius}] in metres, got :junk"}
      iex> Robot.Behaviour.check({Robot.Behaviour.Goto, x: 1.0, y: 2.0, unmapped: 1})
      {:error, "option unmapped: expected true or false, got 1"}
      iex> {:error, line} = Robot.Behaviour.check({Robot.Behaviour.Follow, target: %Hal.Pose{x: :far, y: 0.0, heading: 0.0}})
      iex> line =~ "option target: expected a %Hal.Pose{} in metres and radians, got %Hal.Pose{"
      true
  """
  @spec check(term()) :: :ok | {:error, line :: String.t()}
  def check(nil), do: :ok

  def check({module, options}) when is_atom(module) and is_list(options) do
    cond do
      not Keyword.keyword?(options) ->
        {:error, "#{inspect(module)}: expected options [key: value], got #{brief(options)}"}

      Code.ensure_loaded?(module) and function_exported?(module, :new, 1) and
          function_exported?(module, :tick, 2) ->
        with :ok <- discs(options),
             :ok <- unmapped(options[:unmapped]),
             do: made(module, Keyword.drop(options, [:discs, :unmapped]))

      true ->
        {:error, "expected a behaviour, a module with new/1 and tick/2, got #{inspect(module)}"}
    end
  end

  def check(other),
    do: {:error, "expected a goal {module, options} or nil, got #{brief(other)}"}

  # Every goal accepts these options in addition to its own (`Robot.Behaviour.Avoid`).
  defp discs(options) do
    discs = Keyword.get(options, :discs, [])

    if discs?(discs),
      do: :ok,
      else: {:error, "option discs: expected [{x, y, radius}] in metres, got #{brief(discs)}"}
  end

  defp unmapped(unmapped?) when unmapped? in [nil, true, false], do: :ok

  defp unmapped(other),
    do: {:error, "option unmapped: expected true or false, got #{brief(other)}"}

  @doc "Whether a term is a list of discs to avoid: `[{x, y, radius}]` in the map frame, metres."
  @spec discs?(term()) :: boolean()
  def discs?(discs),
    do:
      Type.list?(discs) and
        Enum.all?(
          discs,
          &match?({x, y, r} when is_number(x) and is_number(y) and is_number(r) and r > 0, &1)
        )

  # `new/1` raises `ArgumentError` for wrong options.
  defp made(module, options) do
    {_module, _state} = module.new(options)
    :ok
  rescue
    error in ArgumentError -> {:error, "#{inspect(module)}: #{Exception.message(error)}"}
  end

  defp brief(term), do: inspect(term, limit: 5, printable_limit: 40)

  @doc "Runs one tick of a behaviour."
  @spec tick(t(), Percept.t()) :: result()
  def tick({module, state}, %Percept{} = percept), do: module.tick(percept, state)

  @doc "Changes options of a running behaviour; one without `c:update/2` stays as it is."
  @spec update(t(), keyword()) :: t()
  def update({module, state} = behaviour, options) do
    # The module is loaded: its `new/1` returned the pair.
    if function_exported?(module, :update, 2), do: module.update(options, state), else: behaviour
  end

  @doc "Tells a behaviour of its way; one without `c:routed/3` stays as it is."
  @spec routed(t(), route(), Percept.t()) :: t()
  def routed({module, state} = behaviour, route, percept) do
    if function_exported?(module, :routed, 3),
      do: module.routed(route, percept, state),
      else: behaviour
  end

  @doc """
  Changes these options, for `c:update/2`, by the check of `c:new/1`. `keys` are the options that the behaviour keeps in its
  state.
  """
  @spec change(module(), keyword(), state :: map(), keys :: [atom()]) :: t()
  def change(module, options, state, keys) do
    if same?(options, state, keys) do
      {module, state}
    else
      {_, fresh} = module.new(state |> Map.take(keys) |> Map.to_list() |> Keyword.merge(options))
      {module, Map.merge(state, Map.take(fresh, keys))}
    end
  end

  @doc """
  Whether these options change nothing: a mission repeats its goal at each tick, and need not be checked again.

      iex> state = %{near: 1.5, mode: :going}
      iex> for options <- [[near: 1.5], [near: 1.6], [mode: :going]],
      ...>     do: Robot.Behaviour.same?(options, state, [:near])
      [true, false, false]
  """
  @spec same?(keyword(), map(), [atom()]) :: boolean()
  def same?(options, state, keys),
    do: Enum.all?(options, fn {key, value} -> key in keys and state[key] == value end)
end
