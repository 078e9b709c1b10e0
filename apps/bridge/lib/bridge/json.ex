defmodule Bridge.Json do
  @moduledoc "Reads JSON of strangers, by mochiweb's reader. Makes no atoms of it."
  # Debian's package; without it there is no server.
  @compile {:no_warn_undefined, [:mochijson2]}

  @doc """
  The value; objects are maps by text.

      iex> Bridge.Json.decode(~S({"op":"subscribe","ids":[1,2.5,null]}))
      {:ok, %{"op" => "subscribe", "ids" => [1, 2.5, nil]}}
      iex> Bridge.Json.decode("{")
      :error
  """
  @spec decode(binary()) :: {:ok, term()} | :error
  def decode(text) do
    {:ok, text |> :mochijson2.decode(format: :map) |> value()}
  rescue
    # Its reader fails on what is no JSON, in more than one way.
    _error -> :error
  end

  defp value(:null), do: nil
  defp value(list) when is_list(list), do: Enum.map(list, &value/1)
  defp value(map) when is_map(map), do: Map.new(map, fn {key, value} -> {key, value(value)} end)
  defp value(other), do: other
end
