defmodule Sim.Kernel do
  @moduledoc "The heavy work of a world: rays."
  alias Sim.Kernel.Reference

  @typedoc "One robot's sensors: body number, place, cosine and sine of its heading, range limits, geometry."
  @type ring ::
          {index :: non_neg_integer(), x :: float(), y :: float(), cosine :: float(),
           sine :: float(), least :: float(), most :: float(), geometry :: binary()}

  @doc "The sonar ranges of all robots."
  @spec sonar(Sim.Map.t(), [{float(), float(), float()}], [ring()], {integer(), integer()} | nil) ::
          [[float()]]
  defdelegate sonar(map, bodies, rings, noise), to: Reference

  @doc "How far a ray goes before it meets a wall, and on which side."
  @spec wall(Sim.Map.t(), float(), float(), float(), float(), float()) :: {float(), 0..2}
  defdelegate wall(map, x, y, rx, ry, most), to: Reference
end
