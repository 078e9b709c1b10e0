defmodule Hal.Options.Type do
  @moduledoc """
  Reads the values of options by their types in a table of `Hal.Options`: what these accept and return. Pure.

  | type | accepts | returns |
  |---|---|---|
  | `{:number, low, high}`, `{:number, low, high, unit}` | a number | a float |
  | `{:integer, low, high}`, `{:integer, low, high, unit}` | a whole number | the number |
  | `{:span, low, high, unit}` | `{least, most}`, ascending whole numbers of this range | the same |
  | `:integer` | any whole number, such as a seed | the same |
  | `:boolean` | `true`, `false` | the same |
  | `:path`, `{:path, what}` | text of 1 to 4095 bytes without a zero byte | the same |
  | `:ipv4` | an address, as text or `{a, b, c, d}` | the tuple |
  | `{:text, what}` | text of 1 to 255 bytes on one line, without control characters | the same |
  | `{:one_of, values}` | one of these values | the same |
  | `{:list, type}`, `{:list, type, most}` | up to `most` values (64) | a list |
  | `{:tuple, types, what}` | a tuple of these | a tuple |
  | `{:keys, table}` | `[key: value, …]`; a key may be text | a keyword list in the order of the table |
  | `{:or, value, type}` | that value, or what the type accepts | |
  | `{:struct, module}` | such a struct | the same |
  | `:mfa`, `:driver` | `{module, function, arguments}`; `{module, options}` | the same |
  | `{:check, function, what}` | a value for which `function.(value)` is `true` or `{:ok, value}` | the value |

  A `:check` function that has a better explanation than `what` returns the whole sentence,
  `{:error, text}`, or `{:error, problems}`.
  """
  alias Hal.Options.Wording
  alias Hal.Options.Suggest

  @most 64

  @type t :: atom() | tuple()
  @type problem :: Wording.problem()
  @type result :: {:ok, term()} | {:error, [problem(), ...]}

  @doc "Whether a value is a proper list."
  @spec list?(term()) :: boolean()
  def list?(value), do: is_list(value) and not List.improper?(value)

  @doc "Whether a value is `[key: value, …]`; a key may be text."
  @spec keys?(term()) :: boolean()
  def keys?(value) do
    list?(value) and
      Enum.all?(value, &match?({key, _value} when is_atom(key) or is_binary(key), &1))
  end

  @doc """
  Reads a value by its type; the error has all its problems, each with the keys that lead to it.
  Adds no defaults.

      iex> Hal.Options.Type.read({:keys, size: {:number, 0, 2, "m"}}, size: 1)
      {:ok, [size: 1.0]}
      iex> Hal.Options.Type.read({:list, {:integer, 0, 15}}, [3, 16])
      {:error, [{["2"], "expected a whole number from 0 to 15, got 16"}]}
      iex> Hal.Options.Type.read({:one_of, [:manual, :auto]}, :manaul)
      {:error, [{[], "expected :manual or :auto, got :manaul; did you mean :manual?"}]}
      iex> Hal.Options.Type.read({:keys, length: {:number, 0.1, 2.0}, lid: :boolean}, [{"lenght", 3}])
      {:error, [{["lenght"], "is not known: allowed are length, lid; did you mean length?"}]}
  """
  @spec read(t(), term()) :: result()
  def read({:or, value, _type}, value), do: {:ok, value}

  def read({:or, _value, type} = either, value) do
    case {read(type, value), Wording.refuse(type, value)} do
      {plain, plain} -> Wording.refuse(either, value)
      {result, _plain} -> result
    end
  end

  def read({:list, type}, value), do: read({:list, type, @most}, value)

  def read({:list, type, most} = list, value) do
    if is_list(value) and not List.improper?(value) and length(value) <= most,
      do:
        value |> Enum.with_index(1) |> Enum.map(fn {v, n} -> under(n, read(type, v)) end) |> all(),
      else: Wording.refuse(list, value)
  end

  def read({:tuple, types, _what}, value)
      when is_tuple(value) and tuple_size(value) == length(types) do
    with {:ok, values} <- all(Enum.zip_with(types, Tuple.to_list(value), &read/2)),
         do: {:ok, List.to_tuple(values)}
  end

  def read({:keys, table} = type, value),
    do: if(keys?(value), do: keys(table, value), else: Wording.refuse(type, value))

  def read({:check, function, _what} = type, value) do
    case function.(value) do
      true -> {:ok, value}
      {:ok, value} -> {:ok, value}
      {:error, text} when is_binary(text) -> {:error, [{[], text}]}
      {:error, [_ | _] = problems} -> {:error, problems}
      _no -> Wording.refuse(type, value)
    end
  end

  def read(:ipv4, value) when is_binary(value) do
    with {:error, _reason} <- :inet.parse_ipv4strict_address(:binary.bin_to_list(value)),
         do: Wording.refuse(:ipv4, value)
  end

  def read(type, value) do
    cond do
      not takes?(type, value) -> Wording.refuse(type, value)
      is_tuple(type) and elem(type, 0) == :number -> {:ok, value * 1.0}
      true -> {:ok, value}
    end
  end

  defp takes?(:boolean, value), do: is_boolean(value)
  defp takes?(:integer, value), do: is_integer(value)

  defp takes?(:path, value),
    do: is_binary(value) and byte_size(value) in 1..4_095 and not String.contains?(value, <<0>>)

  defp takes?(:ipv4, ip),
    do: is_tuple(ip) and tuple_size(ip) == 4 and Enum.all?(Tuple.to_list(ip), &(&1 in 0..255))

  defp takes?({:path, _what}, value), do: takes?(:path, value)

  defp takes?({:text, _what}, value) do
    is_binary(value) and byte_size(value) in 1..255 and String.printable?(value) and
      not String.match?(value, ~r/[[:cntrl:]]/)
  end

  defp takes?({:one_of, values}, value), do: value in values
  defp takes?({:struct, module}, value), do: is_struct(value, module)
  defp takes?(:mfa, {m, f, a}), do: is_atom(m) and is_atom(f) and is_list(a)
  defp takes?(:driver, {m, options}), do: is_atom(m) and Keyword.keyword?(options)
  defp takes?({:integer, l, h}, value), do: is_integer(value) and value >= l and value <= h
  defp takes?({:integer, l, h, _unit}, value), do: takes?({:integer, l, h}, value)

  defp takes?({:span, low, high, _unit}, {least, most}),
    do: is_integer(least) and is_integer(most) and low <= least and least <= most and most <= high

  defp takes?({:number, l, h}, value), do: is_number(value) and value >= l and value <= h
  defp takes?({:number, l, h, _unit}, value), do: takes?({:number, l, h}, value)
  defp takes?(_type, _value), do: false

  defp keys(table, given) do
    given = for {key, value} <- given, do: {known(key, table), value}

    unknown =
      for {key, _value} <- given, not List.keymember?(table, key, 0), do: strange(key, table)

    found =
      for {key, type} <- table do
        values = for {^key, value} <- given, do: value
        {key, under(key, find(List.wrap(type), values))}
      end

    case Enum.uniq(unknown) ++ for({_key, {:error, some}} <- found, one <- some, do: one) do
      [] -> {:ok, for({key, {:ok, value}} <- found, do: {key, value})}
      problems -> {:error, problems}
    end
  end

  # A key that is text is that of the table with this name; no text becomes an atom.
  defp known(key, _table) when is_atom(key), do: key

  defp known(text, table),
    do:
      Enum.find_value(table, text, fn {key, _type} -> if Atom.to_string(key) == text, do: key end)

  defp strange(key, table) do
    names = for {key, _type} <- table, do: Atom.to_string(key)
    name = to_string(key)
    {[name], "is not known: allowed are #{Enum.join(names, ", ")}#{Suggest.hint(name, names)}"}
  end

  defp find([type | settings], []) do
    if settings[:required],
      do: {:error, [{[], "is missing: expected #{Wording.expected(type)}"}]},
      else: :absent
  end

  defp find([type | settings], [value]) do
    if value == nil and Keyword.get(settings, :default, :none) == nil,
      do: {:ok, nil},
      else: read(type, value)
  end

  defp find(_type, _values), do: {:error, [{[], "is given twice"}]}

  defp under(key, {:error, problems}),
    do: {:error, for({path, text} <- problems, do: {["#{key}" | path], text})}

  defp under(_key, result), do: result

  @doc "Joins results: all values, or all problems."
  @spec all([result()]) :: {:ok, [term()]} | {:error, [problem(), ...]}
  def all(results) do
    case for {:error, problems} <- results, problem <- problems, do: problem do
      [] -> {:ok, Enum.map(results, &elem(&1, 1))}
      problems -> {:error, problems}
    end
  end
end
