defmodule Robot.File.Device do
  @moduledoc """
  Reads the drivers that a robot file names, such as `{Hal.RFlex.Driver, port: "/dev/ttyR0"}`.

  A driver is a module of this build that exports the main callback of its kind. It may describe
  its options with `option_table/0`, and check what a table cannot express with `options/1`, which
  returns `{:ok, all options} | {:error, line}`. Names in options are compared with existing
  atoms; a file never creates atoms. A drive with an option `profile:` gets the body of the file.
  """
  alias Hal.Options.{Type, Wording}
  alias Hal.Options.Suggest
  alias Robot.File.Terms
  alias Robot.File.Terms.Name

  @kinds %{
    drive: {:drive, 2, "Hal.Drive"},
    ptz: {:look, 3, "Hal.Ptz"},
    camera: {:next, 1, "Hal.Camera"},
    scan: {:handle_message, 2, "Hal.Lidar"}
  }
  # Listed here, so that their names are existing atoms before any of these modules is loaded.
  @ours %{
    drive: Hal.RFlex.Driver,
    ptz: Hal.Visca.Driver,
    camera: Hal.Camera.FFmpeg,
    scan: Hal.RPLidar.Driver
  }

  @doc "The option type of a driver with its options, for a table of `Hal.Options`."
  @spec type(Hal.Device.kind()) :: Type.t()
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
  Adds the body to the options of a drive, if the drive has an option `profile:`; or one line that
  says what does not fit the body.
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
  A drive's judgement of its options with this body (`c:Hal.Drive.judge/1`); `nil` if the drive
  does not export `judge/1`, or if the options do not pass.
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

      not function_exported?(name, function, arity) or (kind == :scan and drives?(name)) ->
        {:error, "names #{inspect(name)}, which is not a #{behaviour}"}

      true ->
        {:ok, name}
    end
  end

  # A lidar is told nothing, so it has no callback that others do not have.
  defp drives?(module) do
    Enum.any?([drive: 2, look: 3, next: 1], fn {name, arity} ->
      function_exported?(module, name, arity)
    end)
  end

  defp refused(allowed, value) do
    {:error, [{[], text}]} = Wording.refuse(allowed, value)
    text
  end

  @doc """
  Why a driver refuses these options, in one line; `nil` if it accepts them or does not export
  `options/1`.
  """
  @spec refused_by(module(), keyword()) :: String.t() | nil
  def refused_by(module, options) do
    # Checked at run time: `options/1` is optional for a driver.
    case function_exported?(module, :options, 1) && module.options(options) do
      {:error, line} -> line
      _well -> nil
    end
  end
end
