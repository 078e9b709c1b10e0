defmodule Lab.Trial.Form do
  @moduledoc false
  # Checks values of the form `{name, value, …, key: value}`, such as events of a script and
  # expectations of a scenario. Pure; makes no atoms.
  #
  # A form is `{name, values, keys}`: `values` are `{label, type}`, `keys` is a table of
  # `Hal.Options`. A name alone stands for `{name}`.
  alias Hal.Options.{Suggest, Type, Wording}

  @type form :: {atom(), [{atom(), Type.t()}], Hal.Options.table()}

  @doc """
  The value, with its values and keys as their types return them, or what is wrong with it. `what`
  is what such a value is called.

      iex> forms = [{:wait, [for_s: {:number, 0, 9, "s"}], []}, {:reset, [], []}, {:still, [], [by_s: {:number, 0, 9}]}]
      iex> Lab.Trial.Form.read({:wait, 2}, forms, "an event")
      {:ok, {:wait, 2.0}}
      iex> Lab.Trial.Form.read(:reset, forms, "an event")
      {:ok, {:reset}}
      iex> Lab.Trial.Form.read({:still, by_s: 1}, forms, "an event")
      {:ok, {:still, [by_s: 1.0]}}
      iex> Lab.Trial.Form.read({:wiat, 2}, forms, "an event")
      {:error, [{[], "expected an event, one of wait, reset, still, got {:wiat, 2}; did you mean wait?"}]}
      iex> Lab.Trial.Form.read({:wait, 2, 3}, forms, "an event")
      {:error, [{[], "expected {:wait, for_s}, got {:wait, 2, 3}"}]}
  """
  @spec read(term(), [form()], what :: String.t()) :: Type.result()
  def read(term, forms, what) do
    [name | values] = if is_tuple(term) and term != {}, do: Tuple.to_list(term), else: [term]

    case List.keyfind(forms, name, 0) do
      nil -> unknown(term, name, forms, what)
      form -> values(term, form, values)
    end
  end

  defp unknown(term, name, forms, what) do
    names = for {name, _values, _keys} <- forms, do: Atom.to_string(name)
    word = if is_struct(name) or is_atom(name), do: inspect(name), else: ""

    {:error,
     [
       {[],
        "expected #{what}, one of #{Enum.join(names, ", ")}, got #{Wording.show(term)}" <>
          Suggest.hint(String.trim_leading(word, ":"), names)}
     ]}
  end

  defp values(term, {name, types, keys} = form, given) do
    case Enum.split(given, length(types)) do
      {values, rest} when length(values) == length(types) and (rest == [] or keys != []) ->
        with {:ok, values} <- Type.all(Enum.zip_with(types, values, &value/2)),
             {:ok, options} <- keys(term, form, rest),
             do: {:ok, List.to_tuple([name | values] ++ options)}

      _too_few_or_many ->
        Wording.refuse(usage(form), term)
    end
  end

  defp value({label, type}, value) do
    with {:error, problems} <- Type.read(type, value),
         do: {:error, for({path, text} <- problems, do: {[Atom.to_string(label) | path], text})}
  end

  defp keys(_term, {_name, _types, []}, []), do: {:ok, []}

  defp keys(term, {_name, _types, keys} = form, rest) when length(rest) < 2 do
    options = List.first(rest, [])

    cond do
      not Type.keys?(options) -> Wording.refuse(usage(form), term)
      rest == [] and not required?(keys) -> {:ok, []}
      true -> with {:ok, options} <- Type.read({:keys, keys}, options), do: {:ok, listed(options)}
    end
  end

  defp keys(term, form, _too_many), do: Wording.refuse(usage(form), term)

  defp required?(keys),
    do: Enum.any?(keys, fn {_key, type} -> type |> List.wrap() |> tl() != [] end)

  defp listed([]), do: []
  defp listed(options), do: [options]

  @doc """
  How a form is written.

      iex> Lab.Trial.Form.usage({:at, [robot: :integer, place: :integer], [within_m: [:integer, required: true], by_s: :integer]})
      "{:at, robot, place, within_m: …} with by_s, if wanted,"
  """
  @spec usage(form()) :: String.t()
  def usage({name, types, keys}) do
    {must, may} = Enum.split_with(keys, &required?([&1]))
    labels = for {label, _type} <- types, do: ", #{label}"
    must = for {key, _type} <- must, do: ", #{key}: …"
    may = for {key, _type} <- may, do: "#{key}"
    usage = "{#{inspect(name)}#{labels}#{must}}"
    if may == [], do: usage, else: "#{usage} with #{Enum.join(may, ", ")}, if wanted,"
  end
end
