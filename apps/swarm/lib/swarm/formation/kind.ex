defmodule Swarm.Formation.Kind do
  @moduledoc """
  Defines a shape that a build adds to those of `Swarm.Formation`; the configuration gives it a name. Pure: each robot
  computes the slots by itself, and all must get the same result.

      defmodule Mine.Echelon do
        @behaviour Swarm.Formation.Kind

        @impl Swarm.Formation.Kind
        def slot(rank, _robots), do: {-0.8 * rank, 0.8 * rank}
      end
  """

  @doc """
  The slot of the follower with this rank (1 is the first behind the leader) in a group of `robots`, the leader
  included: ahead and to the left of the leader, in units of the spacing. No two slots, and no slot and the leader
  at `{0.0, 0.0}`, may be nearer to each other than 1.0.
  """
  @callback slot(rank :: pos_integer(), robots :: pos_integer()) :: {x :: float(), y :: float()}
end
