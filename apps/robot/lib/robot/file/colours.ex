defmodule Robot.File.Colours do
  @moduledoc false
  # Reads the colours of a robot file: the path of a CMVision colour file, or a list of keys with that path and the
  # options of `Vision.Colours`.
  alias Hal.Options.Type

  @keys {
    :keys,
    # `Vision.Colours` checks whether the module is a backend.
    file: [{:path, "the path of a colour file"}, required: true],
    distance: {:check, &__MODULE__.distances/1, "%{\"Colour\" => share seen from 1 m}"},
    min_area: {:integer, 1, 16_777_216},
    max_area: {:integer, 0, 16_777_216},
    backend: {:check, &is_atom/1, "a Vision.Backend of this build"}
  }

  @typedoc "Reads a colour file with the options of `Vision.Colours`; an error is one line."
  @type reader :: (Path.t(), keyword() -> {:ok, struct()} | {:error, String.t()})

  @doc "The option type of colours, for a table of `Hal.Options`."
  @spec type(reader()) :: Type.t()
  def type(read), do: {:check, &check(&1, read), "the path of a colour file"}

  defp check(path, read) when is_binary(path), do: check([file: path], read)

  defp check(options, read) do
    with {:ok, options} <- Type.read(@keys, options),
         do: read.(options[:file], Keyword.delete(options, :file))
  end

  @doc false
  def distances(map) when is_map(map) and not is_struct(map) do
    names =
      {:tuple, [{:text, "the name of a colour, in double quotes,"}, {:number, 1.0e-6, 100.0}], ""}

    with {:ok, pairs} <- map |> Map.to_list() |> Enum.map(&Type.read(names, &1)) |> Type.all(),
         do: {:ok, Map.new(pairs)}
  end

  def distances(_other), do: false
end
