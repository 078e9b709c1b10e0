defmodule Robot.Localiser.Silhouettes.Native do
  @moduledoc false
  # The kernel in C; `Robot.Localiser.Silhouettes.Reference` documents it. The C code checks every size and number: wrong
  # terms raise ArgumentError.
  use Hal.Nif, app: :robot, library: "silhouettes"

  @spec fits(binary(), non_neg_integer(), bodies :: binary(), ways :: binary()) ::
          [{wrong :: non_neg_integer(), clear :: non_neg_integer()}]
  def fits(_search, _seen, _bodies, _ways), do: :erlang.nif_error(:nif_not_loaded)
end
