defmodule Hal.Nif do
  @moduledoc """
  Loads functions that are written in C into a module: `use Hal.Nif, app: :robot, library: "grid"` takes `priv/grid` of the
  app. Without the library the module's own functions remain.
  """

  @doc false
  defmacro __using__(app: app, library: library) do
    quote do
      @on_load :load

      @doc false
      @spec load() :: :ok
      def load do
        path = Path.join(Application.app_dir(unquote(app), "priv"), unquote(library))
        _ = :erlang.load_nif(to_charlist(path), 0)
        :ok
      end

      @doc "Whether the C library was built and loaded."
      @spec loaded?() :: boolean()
      # The library replaces this. From a plain `false`, compilers that infer types would conclude
      # that it is never loaded.
      def loaded?, do: not function_exported?(__MODULE__, :loaded?, 0)
    end
  end
end
