defmodule Player.State do
  @moduledoc """
  What is known of a robot while its file is imported: values with the line and name of the option they came from, what
  was assumed, what is left out. Pure.
  """

  @typedoc "A line of the file, the option or section there, and a remark about it."
  @type remark :: {line :: pos_integer(), what :: String.t(), why :: String.t()}
  @type entry :: {path :: [atom()], value :: term(), line :: pos_integer(), option :: String.t()}
  @type t :: %{values: [entry()], assumed: [remark()], left: [remark()], seen: [atom()]}

  @doc "The value at a path, or `nil`."
  @spec value(t(), [atom()]) :: term()
  def value(state, path) do
    with {_path, value, _line, _name} <- List.keyfind(state.values, path, 0), do: value
  end

  @doc "Adds a remark on something that was assumed: in a line, or where the value at a path is from."
  @spec assume(t(), pos_integer(), String.t(), String.t()) :: t()
  def assume(state, line, what, why), do: %{state | assumed: [{line, what, why} | state.assumed]}

  @spec assume(t(), [atom()], String.t()) :: t()
  def assume(state, path, why) do
    {_path, _value, line, option} = List.keyfind(state.values, path, 0)
    assume(state, line, option, why)
  end

  @doc "Adds further values that follow from an option in a line."
  @spec keep(t(), pos_integer(), String.t(), [{[atom()], term()}]) :: t()
  def keep(state, line, name, values) do
    new = for {path, value} <- values, do: {path, value, line, name}
    %{state | values: state.values ++ new}
  end

  @doc "Leaves out the values at these paths, or those that a function chooses, and says why."
  @spec leave(t(), [[atom()]] | (entry() -> boolean()), String.t()) :: t()
  def leave(state, paths, why) when is_list(paths),
    do: leave(state, &(elem(&1, 0) in paths), why)

  def leave(state, which, why) do
    {gone, values} = Enum.split_with(state.values, which)
    left = for {_path, _value, line, option} <- gone, do: {line, option, why}
    %{state | values: values, left: Enum.uniq(left) ++ state.left}
  end
end
