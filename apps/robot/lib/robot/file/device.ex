defmodule Robot.File.Device do
  @moduledoc """
  The drivers that a robot file names, as `{Hal.RFlex.Driver, port: "/dev/ttyR0"}`.

  A driver is a module of this build with the callbacks of its kind. What options it takes it says
  itself, if it exports `option_table/0`; what no table can say, `options/1`: `{:ok, all options} | {:error, line}`.
  Names in options are compared with the atoms that there are; a file makes none. A drive that has an option
  `profile:` is given the body of the file, with its limits.
  """
  alias Hal.Options.{Type, Wording}
  alias Hal.Options.Suggest
  alias Robot.File.Terms
  alias Robot.File.Terms.Name

  @kinds %{
    drive: {:drive, 2, "Hal.Drive"},
    ptz: {:look, 3, "Hal.Ptz"},
    camera: {:next, 1, "Hal.Camera"}
  }
  # Named here, so that their names are known before any of them is loaded.
  @ours %{drive: Hal.RFlex.Driver, ptz: Hal.Visca.Driver, camera: Hal.Camera.FFmpeg}

  @doc "The type of a driver with its options, for a table."
  @spec type(:drive | :ptz | :camera) :: Type.t()
  def type(kind),
    do: {:check, &check(kind, &1), "{driver, options}, such as {#{inspect(@ours[kind])}, […]},"}

  defp check(kind, {name, options}) when is_list(options) do
    with true <- name?(name) and Type.keys?(options),
         {:ok, module} <- module(kind, name),
         {:ok, options} <- options(module, options),
         do: {:ok, {module, options}}
  end

  defp check(kind, name), do: not is_tuple(name) and name?(name) and check(kind, {name, []})

  defp name?(%Name{text: text}), do: not String.starts_with?(text, ":")
  defp name?(name), do: is_atom(name) and match?("Elixir." <> _, Atom.to_string(name))

  defp options(module, given) do
    case {table(module), Terms.strange(Enum.map(given, &elem(&1, 1)))} do
      {nil, nil} ->
        existing(given)

      {nil, name} ->
        {:error, [{[key(given, name)], refused("a name that this build knows", name)}]}

      {table, _name} ->
        Type.read({:keys, table}, given)
    end
    |> judged(module)
  end

  defp existing(given) do
    case for {name, _value} <- given, is_binary(name), do: name do
      [] -> {:ok, given}
      names -> {:error, for(name <- names, do: {[name], "is not an option of any driver"})}
    end
  end

  defp judged({:ok, options}, module) do
    with nil <- refused_by(module, options), do: {:ok, options}, else: (line -> {:error, line})
  end

  defp judged(error, _module), do: error

  defp key(given, name) do
    Enum.find_value(given, fn {key, value} -> Terms.strange([value]) == name && to_string(key) end)
  end

  @doc """
  The options of a drive with the body that they are for, if it has a place for it; or one line that says what
  does not fit the body.
  """
  @spec fit({module(), keyword()}, Hal.Profile.t()) ::
          {:ok, {module(), keyword()}} | {:error, String.t()}
  def fit({module, options}, profile) do
    if Keyword.has_key?(table(module) || [], :profile) do
      options = Keyword.put_new(options, :profile, profile)
      line = refused_by(module, options)
      if line, do: {:error, line}, else: {:ok, {module, options}}
    else
      {:ok, {module, options}}
    end
  end

  @doc """
  What a drive says of its options, with the body that they are for (`c:Hal.Drive.judge/1`); `nil` of one that
  does not tell.
  """
  @spec judge({module(), keyword()}, Hal.Profile.t()) :: Hal.Drive.judgement() | nil
  def judge({module, _options} = drive, profile) do
    with true <- Code.ensure_loaded?(module) and function_exported?(module, :judge, 1),
         {:ok, {module, options}} <- fit(drive, profile),
         {:ok, judgement} <- module.judge(options) do
      judgement
    else
      _silent -> nil
    end
  end

  defp table(module) do
    if Code.ensure_loaded?(module) and function_exported?(module, :option_table, 0),
      do: module.option_table()
  end

  defp module(kind, name) do
    {function, arity, behaviour} = @kinds[kind]

    cond do
      is_struct(name) or not Code.ensure_loaded?(name) ->
        ours = inspect(@ours[kind])

        {:error,
         refused("a driver of this build such as #{ours}", name) <>
           Suggest.hint(inspect(name), [ours])}

      not function_exported?(name, function, arity) ->
        {:error, "names #{inspect(name)}, which is not a #{behaviour}"}

      true ->
        {:ok, name}
    end
  end

  defp refused(allowed, value) do
    {:error, [{[], text}]} = Wording.refuse(allowed, value)
    text
  end

  @doc "What a driver has against these options, in one line; `nil` for nothing, or if it does not tell."
  @spec refused_by(module(), keyword()) :: String.t() | nil
  def refused_by(module, options) do
    # Looked for at run time: a driver may have no such function.
    case function_exported?(module, :options, 1) && module.options(options) do
      {:error, line} -> line
      _well -> nil
    end
  end
end
