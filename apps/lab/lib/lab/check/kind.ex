defmodule Lab.Check.Kind do
  @moduledoc """
  Defines what a check does. `Lab.Check.Expectation` has the table of all, by the words of scenario files; a new one is a
  clause or a module with these callbacks, and a line in that table.
  """
  alias Lab.Check.Violation
  alias Lab.Moment

  @typedoc """
  What a check says of a moment. What must come about (`:reach`) holds as soon as it does, and fails when its time is up. What
  must be so all the time (`:keep`) fails as soon as it is not, and holds when its time is up, or the run. What is `:never` to
  be has the violations of this moment, of all invariants that the check judges. `:unseen`: what it judges is inside processes.
  """
  @type answer ::
          {:reach | :keep, so? :: boolean(), figures :: String.t(), memory()}
          | {:never, [Violation.t()], memory()}
          | :unseen

  @typedoc "What to remember until the next moment."
  @type memory :: term()

  @doc "What the check remembers before the first moment of a run with these options (`Lab.Trial.Options`)."
  @callback new(options :: map()) :: memory()

  @doc "One moment, every 100 ms, of what is asked (`t:Lab.Check.Expectation.t/0`; a check of invariants judges all its words)."
  @callback note(asked :: tuple(), Moment.t(), memory()) :: answer()

  @doc "What only the report of the run shows (`Lab.Trial.result/1`)."
  @callback finish(memory(), result :: map()) :: [Violation.t()]
  @optional_callbacks finish: 2
end
