defmodule Hal.Options.Wording do
  @moduledoc "Words the errors in options: what was expected, and what came instead. Pure."
  alias Hal.Options.Suggest

  @longest 80

  @type problem :: {path :: [String.t()], text :: String.t()}

  @doc "The problem of a value that does not have this type, or does not fit this description."
  @spec refuse(Hal.Options.Type.t() | String.t(), term()) :: {:error, [problem(), ...]}
  def refuse(type, value) do
    hint = with({:one_of, values} <- type, do: Suggest.hint(show(value), values), else: (_ -> ""))
    {:error, [{[], "expected #{expected(type)}, got #{show(value)}#{hint}"}]}
  end

  @doc "What a type accepts, at the end of a phrase."
  @spec expected(Hal.Options.Type.t() | String.t()) :: String.t()
  def expected(type), do: String.trim_trailing(allowed(type), ",")

  @doc """
  What a type accepts, in words.

      iex> Hal.Options.Wording.allowed({:or, :off, {:list, {:integer, 0, 16, "sonars"}}})
      ":off or a list of up to 64, each a whole number from 0 to 16 sonars,"
  """
  @spec allowed(Hal.Options.Type.t() | String.t()) :: String.t()
  def allowed(text) when is_binary(text), do: text
  def allowed(:boolean), do: "true or false"
  def allowed(:integer), do: "a whole number"
  def allowed(:path), do: "a path"
  def allowed(:ipv4), do: ~s(an IPv4 address such as "10.0.0.7")
  def allowed(:mfa), do: "{module, function, arguments}"
  def allowed(:driver), do: "{module, options}"
  def allowed({kind, what}) when kind in [:text, :path], do: what
  def allowed({:number, low, high}), do: "a number from #{low} to #{high}"
  def allowed({:integer, low, high}), do: "a whole number from #{low} to #{high}"
  def allowed({:span, low, high, unit}), do: "{least, most}, #{unit} from #{low} to #{high},"
  def allowed({type, low, high, unit}), do: "#{allowed({type, low, high})} #{unit}"
  def allowed({:one_of, values}), do: either(Enum.map(values, &inspect/1))
  def allowed({:struct, module}), do: "a %#{inspect(module)}{}"
  def allowed({:or, value, type}), do: "#{inspect(value)} or #{allowed(type)}"
  def allowed({:list, type}), do: allowed({:list, type, 64})
  def allowed({:list, type, most}), do: "a list of up to #{most}, each #{allowed(type)},"
  def allowed({kind, _types, what}) when kind in [:tuple, :check], do: what
  def allowed({:keys, table}), do: "[key: value, …] with #{list(Keyword.keys(table))}"

  defp either([one]), do: one
  defp either(words), do: "#{list(Enum.drop(words, -1))} or #{List.last(words)}"

  defp list(words), do: Enum.join(words, ", ")

  @doc """
  The keys that lead to a problem, on one line; each is cut to 80 characters.

      iex> Hal.Options.Wording.path(["limits", "max_turn"])
      "limits.max_turn"
      iex> Hal.Options.Wording.path([String.duplicate("a", 1_000_000)]) |> String.length()
      80
  """
  @spec path([String.t()]) :: String.t()
  def path(keys), do: Enum.map_join(keys, ".", &key/1)

  defp key(key) do
    if String.printable?(key) and not String.match?(key, ~r/[[:cntrl:]]/),
      do: cut(key),
      else: show(key)
  end

  @doc "A value on one line of at most 80 characters."
  @spec show(term()) :: String.t()
  def show(value) do
    value
    |> inspect(limit: 20, printable_limit: 60, width: :infinity, charlists: :as_lists)
    |> cut()
  end

  defp cut(text),
    do:
      if(String.length(text) > @longest,
        do: String.slice(text, 0, @longest - 1) <> "…",
        else: text
      )
end
