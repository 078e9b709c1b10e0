defmodule Robot.File.Device do
  @moduledoc """
  The drivers that a robot file names, as `{Hal.RFlex.Driver, port: "/dev/ttyR0"}`.

  A driver is a module of this build with the callbacks of its kind. What options it takes it says
  itself, if it exports `options/1`: `{:ok, all options} | {:error, line | [line]}`. Names in options
  are compared with the atoms that there are; a file makes none. A drive that has an option `profile:`
  is given the body of the file, with its limits.
  """
  alias Hal.{Build, Suggest}
  alias Robot.File.{Check, Options, Reader}

  @kinds %{
    drive: {:drive, 2, "Hal.Drive"},
    ptz: {:look, 3, "Hal.Ptz"},
    camera: {:next, 1, "Hal.Camera"}
  }
  # Named here, so that their names are known before any of them is loaded.
  @ours %{
    drive: [Hal.RFlex.Driver],
    ptz: [Hal.Visca.Driver],
    camera: [Hal.Camera.FFmpeg]
  }

  @doc "The `{driver, options}` that a node names."
  @spec check(:drive | :ptz | :camera, Reader.tree(), [String.t()]) :: Check.result()
  def check(kind, {line, {:module, _name}} = module, path),
    do: check(kind, {line, {:tuple, [module, {line, {:list, []}}]}}, path)

  def check(kind, {line, {:tuple, [{_, {:module, name}} = module, {_at, options}]}} = node, path) do
    case options do
      {:keys, keys} -> driver(kind, module, name, keys, path)
      {:list, []} -> driver(kind, module, name, [], path)
      _other -> refuse(kind, {line, elem(node, 1)}, path)
    end
  end

  def check(kind, node, path), do: refuse(kind, node, path)

  defp refuse(kind, node, path) do
    [ours] = @ours[kind]
    Check.refuse("{driver, options} is allowed, such as {#{inspect(ours)}, […]}", node, path)
  end

  defp driver(kind, {line, _} = node, name, keys, path) do
    with {:ok, module} <- module(kind, name, node, path),
         {:ok, options} <- Options.read(keys, path, known(module)) do
      case refused(module, options) do
        [] -> {:ok, {module, options}}
        lines -> {:error, for(text <- lines, do: {line, path, text})}
      end
    end
  end

  @doc """
  The options of a drive with the body that they are for, if it has a place for it; or what does not fit
  the body, a line each.
  """
  @spec fit({module(), keyword()}, Hal.Profile.t()) ::
          {:ok, {module(), keyword()}} | {:error, [String.t(), ...]}
  def fit({module, options}, profile) do
    if Map.has_key?(known(module), :profile) do
      options = Keyword.put_new(options, :profile, profile)

      with [] <- refused(module, options),
           do: {:ok, {module, options}},
           else: (lines -> {:error, lines})
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

  # What a driver makes of the least that it can be told holds all its options, with the keys of
  # those that are lists of keys; of a driver that does not tell, nothing is known.
  defp known(module) do
    if function_exported?(module, :options, 1) do
      Enum.find_value([[port: "/dev/null"], [source: "testsrc"], []], %{}, fn least ->
        with {:ok, all} <- module.options(least), do: Map.new(pairs(all)), else: (_no -> nil)
      end)
    else
      %{}
    end
  end

  defp pairs(%_{} = all), do: all |> Map.from_struct() |> pairs()

  defp pairs(all) when is_map(all) or is_list(all),
    do: Enum.map(all, fn {key, value} -> {key, below(value)} end)

  defp below(%_{} = value), do: Map.new(pairs(value))
  defp below([{key, _value} | _] = list) when is_atom(key), do: Map.new(pairs(list))
  defp below(_value), do: %{}

  defp module(kind, name, {line, _} = node, path) do
    {function, arity, behaviour} = @kinds[kind]
    ours = Enum.map(@ours[kind], &inspect/1)
    hint = with nil <- Suggest.nearest(name, ours), do: hd(ours)

    case Build.module(name) do
      {:ok, module} ->
        if function_exported?(module, function, arity),
          do: {:ok, module},
          else: {:error, [{line, path, "#{name} is no #{behaviour}"}]}

      :error ->
        hint = if hint == name, do: "", else: "; did you mean #{hint}?"
        Check.refuse("a driver of this build is allowed", node, path, hint)
    end
  end

  @doc "What a driver has against these options, a line each; nothing if it does not tell."
  @spec refused(module(), keyword()) :: [String.t()]
  def refused(module, options) do
    # Looked for at run time: a driver may have no such function.
    case function_exported?(module, :options, 1) && module.options(options) do
      {:error, lines} -> List.wrap(lines)
      _well -> []
    end
  end
end
