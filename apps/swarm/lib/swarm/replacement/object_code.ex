defmodule Swarm.Replacement.ObjectCode do
  @moduledoc false
  # Checks object code that came from elsewhere before anything reads it: its form, and that no part of it unpacks to
  # more than it may. Whether a VM can load it, no function can tell without one: `Swarm.Replacement.Rehearsal`.

  alias Hal.ExternalTerm

  # Of a module's literals, unpacked, and of its attributes.
  @most_literals 2_000_000
  @most_attributes 100_000

  @doc """
  Whether this is the object code of the module of this name, not packed and of a whole form, and whether the module declares
  itself a `Robot.Mission`.
  """
  @spec read(name :: String.t(), binary()) :: {:ok, mission? :: boolean()} | :error
  def read(name, <<"FOR1", size::32, "BEAM", chunks::binary>> = beam)
      when size == byte_size(chunks) + 4 do
    with {:ok, chunks} <- chunks(chunks, %{}),
         true <- Enum.all?(chunks, &bounded?/1),
         {:ok, {module, [attributes: attributes]}} <- :beam_lib.chunks(beam, [:attributes]),
         true <- Atom.to_string(module) == name,
         true <- Keyword.keyword?(attributes) do
      {:ok, Enum.any?(attributes, &mission?/1)}
    else
      _damaged -> :error
    end
  rescue
    # `beam_lib` believes what is inside a chunk.
    _damaged in [ArgumentError, ErlangError, FunctionClauseError, MatchError, CaseClauseError] ->
      :error
  end

  def read(_name, _other), do: :error

  defp chunks(<<>>, chunks), do: {:ok, chunks}

  defp chunks(<<id::binary-size(4), size::32, rest::binary>>, chunks) do
    padding = rem(4 - rem(size, 4), 4)

    case rest do
      <<content::binary-size(size), _zeros::binary-size(padding), rest::binary>>
      when not is_map_key(chunks, id) ->
        chunks(rest, Map.put(chunks, id, content))

      _too_short_or_twice ->
        :error
    end
  end

  defp chunks(_other, _chunks), do: :error

  defp bounded?({"LitT", <<size::32, _packed::binary>>}), do: size <= @most_literals
  defp bounded?({"LitT", _cut}), do: false
  defp bounded?({"Attr", term}), do: ExternalTerm.bounded?(term, @most_attributes)
  defp bounded?(_other), do: true

  defp mission?({:behaviour, value}),
    do: is_list(value) and Enum.any?(value, &(&1 == Robot.Mission))

  defp mission?(_other), do: false
end
