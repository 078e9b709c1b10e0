defmodule Robot.Localiser.Silhouettes.Native do
  @moduledoc false
  # The kernel in C; `Robot.Localiser.Silhouettes.Reference` documents it. The C code checks every size and number: wrong
  # terms raise ArgumentError.
  @on_load :load

  @doc false
  @spec load() :: :ok
  def load do
    # Without the library the stubs remain, and the reference does the work.
    _ = :erlang.load_nif(to_charlist(Application.app_dir(:robot, "priv/silhouettes")), 0)
    :ok
  end

  @spec loaded?() :: boolean()
  # The library replaces this. From a plain `false`, compilers that infer types would conclude
  # that it is never loaded.
  def loaded?, do: not function_exported?(__MODULE__, :loaded?, 0)

  @spec fits(binary(), non_neg_integer(), bodies :: binary(), ways :: binary()) ::
          [{wrong :: non_neg_integer(), clear :: non_neg_integer()}]
  def fits(_search, _seen, _bodies, _ways), do: :erlang.nif_error(:nif_not_loaded)
end
