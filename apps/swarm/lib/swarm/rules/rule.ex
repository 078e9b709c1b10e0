defmodule Swarm.Rules.Rule do
  @moduledoc "A rule of `Swarm.Rules`, as data."
  @enforce_keys [:name, :lines, :then]
  defstruct @enforce_keys ++ [priority: 0]

  @typedoc "A variable, a value (`{:name, text}`: a name of a file), or whatever it is."
  @type term_of_rule :: {:var, String.t()} | {:value, term()} | :any
  @typedoc "The name of a fact, and its values."
  @type pattern :: [String.t() | term_of_rule()]
  @type test :: {:< | :<= | :> | :>= | :== | :!=, term_of_rule(), term_of_rule()}

  @type t :: %__MODULE__{
          name: String.t(),
          priority: integer(),
          lines: [{:fact | :absent, pattern()} | {:where, [test()]}],
          then: [{:conclude | :propose, pattern()}, ...]
        }
end
