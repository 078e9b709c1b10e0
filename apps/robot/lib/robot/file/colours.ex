defmodule Robot.File.Colours do
  @moduledoc """
  The colours of a robot file: the path of a CMVision colour file, or a list of keys with that path
  and the options of `Vision.Colours`.
  """
  alias Robot.File.{Check, Reader}

  @area {:whole, 0, 16_777_216}

  @typedoc "Reads a colour file; its errors are one line."
  @type reader :: (Path.t(), keyword() -> {:ok, struct()} | {:error, String.t()})

  @doc "The colours that a node names."
  @spec check(Reader.tree(), [String.t()], reader()) :: Check.result()
  def check({line, text}, path, read) when is_binary(text),
    do: check({line, {:keys, [{"file", line, {line, text}}]}}, path, read)

  def check({line, _value} = node, path, read) do
    table =
      {:keys,
       file: {:text, "the path of a colour file"},
       distance: {:with, &distances/2},
       min_area: put_elem(@area, 1, 1),
       max_area: @area,
       backend: {:with, &backend/2}}

    with {:ok, options} <- Check.run(table, node, path),
         {:ok, file} <- file(options, line, path) do
      case read.(file, Keyword.delete(options, :file)) do
        {:ok, colours} -> {:ok, colours}
        {:error, why} -> {:error, [{line, path, why}]}
      end
    end
  end

  defp file(options, line, path) do
    case Keyword.fetch(options, :file) do
      {:ok, file} -> {:ok, file}
      :error -> {:error, [{line, path, ~s(needs file:, the path of a colour file)}]}
    end
  end

  # Whether it is a backend is for the colours to say.
  defp backend({_line, {:module, name}} = node, path) do
    with :error <- Hal.Build.module(name), do: refused(node, path)
  end

  defp backend(node, path), do: refused(node, path)

  defp refused(node, path),
    do: Check.refuse("a Vision.Backend of this build is allowed", node, path)

  defp distances({_line, {:map, pairs}}, path) do
    results =
      for {{_, name} = key, value} <- pairs do
        if is_binary(name),
          do: constant(name, value, path),
          else: Check.refuse("the name of a colour is allowed, in double quotes", key, path)
      end

    with {:ok, pairs} <- Check.all(results), do: {:ok, Map.new(pairs)}
  end

  defp distances(node, path),
    do: Check.refuse(~s(%{"Colour" => share seen from 1 m} is allowed), node, path)

  defp constant(name, value, path) do
    with {:ok, share} <- Check.run({:number, 1.0e-6, 100.0, ""}, value, path ++ [name]),
         do: {:ok, {name, share}}
  end
end
