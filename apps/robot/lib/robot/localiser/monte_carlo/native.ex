defmodule Robot.Localiser.MonteCarlo.Native do
  @moduledoc false
  # The kernels in C; `Robot.Localiser.MonteCarlo.Reference` documents them. The C code checks every size and number: wrong
  # terms raise ArgumentError. A call takes up to 1000 poses, so that none takes longer than a millisecond.
  use Hal.Nif, app: :robot, library: "particles"

  alias Robot.Localiser.MonteCarlo.Reference

  @spec move(poses :: binary(), step :: binary(), Reference.draw()) :: binary()
  def move(_poses, _step, _draw), do: :erlang.nif_error(:nif_not_loaded)

  @spec scatter(non_neg_integer(), Reference.plan(), 0..255, float(), Reference.draw()) ::
          binary()
  def scatter(_count, _map, _need, _slip_sd, _draw), do: :erlang.nif_error(:nif_not_loaded)

  @spec weigh(poses :: binary(), Reference.plan(), readings :: binary(), tables :: binary()) ::
          binary()
  def weigh(_poses, _map, _readings, _tables), do: :erlang.nif_error(:nif_not_loaded)
end
