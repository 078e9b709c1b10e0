defmodule Swarm.Replacement.Code do
  @moduledoc false
  # Decides which code an order may bring, and its way into the node and out again.
  #
  # An order may bring a mission (`Robot.Mission`) and modules below its name, `Ours.Gather` and `Ours.Gather.Circle`.
  # Each must be one that this node does not have, or belong to an application in which missions live
  # (`Swarm.Missions.apps/0`): never to one that carries the robot.
  alias Hal.Options.Wording
  alias Swarm.Missions
  alias Swarm.Replacement.{ObjectCode, Order}

  # What carries the robot, even if a mission of it is configured.
  @carrying [:hal, :vision, :robot, :mesh, :swarm]

  @typedoc "What was loaded before: object code, or nothing."
  @type earlier :: [{module(), binary() | :absent}]

  @typedoc "Object code by module, of what this node has kept (`keep/0`) or loaded since."
  @type store :: %{module() => binary()}

  @doc """
  The code of a mission as an order carries it: of its file and of those beside it of modules below its name, or
  of modules as `Code.compile_file/1` returns them. The error is one line.
  """
  @spec read(module() | [{module(), binary()}]) ::
          {:ok, mission :: module(), [{String.t(), binary()}]} | {:error, line :: String.t()}
  def read(module) when is_atom(module) and module not in [nil, true, false] do
    case :code.which(module) do
      [_ | _] = file ->
        folder = Path.dirname(file)
        below = for name <- File.ls!(folder), String.starts_with?(name, "#{module}."), do: name

        for name <- below, Path.extname(name) == ".beam" do
          File.read(Path.join(folder, name))
        end
        |> stripped(module)

      _no_file ->
        {:error, "#{inspect(module)} has no file with its code here"}
    end
  end

  def read([{_module, _beam} | _] = modules) do
    if not List.improper?(modules) and
         Enum.all?(modules, &match?({m, b} when is_atom(m) and is_binary(b), &1)),
       do: stripped(for({_module, beam} <- modules, do: {:ok, beam}), nil),
       else: unreadable(modules)
  end

  def read(other), do: unreadable(other)

  defp unreadable(other),
    do:
      {:error,
       "code: expected a mission's module, or [{module, object code}, …], got #{Wording.show(other)}"}

  # What is not executed would only take longer on its way. `Attr` says what is a mission.
  defp stripped(read, named) do
    with {[], beams} <- {for({:error, reason} <- read, do: reason), for({:ok, b} <- read, do: b)},
         {:ok, stripped} <- :beam_lib.strip_files(beams, [~c"Attr"]),
         code = for({module, beam} <- stripped, do: {Atom.to_string(module), unzipped(beam)}),
         {:ok, mission} <- mission(named, code) do
      {:ok, mission, Enum.sort(code)}
    else
      {:error, line} when is_binary(line) -> {:error, line}
      _unreadable -> {:error, "the code cannot be read: it is no object code"}
    end
  rescue
    # What is inside a chunk is damaged.
    _damaged in [ArgumentError, ErlangError, FunctionClauseError, MatchError, CaseClauseError] ->
      {:error, "the code cannot be read: it is no object code"}
  end

  defp unzipped(<<31, 139, _rest::binary>> = beam), do: :zlib.gunzip(beam)
  defp unzipped(beam), do: beam

  defp mission(nil, code) do
    case Enum.filter(code, &mission?/1) do
      [{name, _beam}] -> {:ok, String.to_existing_atom(name)}
      [] -> {:error, "none of these modules is a Robot.Mission"}
      some -> {:error, "more than one mission: #{Enum.map_join(some, ", ", &shown/1)}"}
    end
  end

  defp mission(named, _code), do: {:ok, named}

  defp shown({name, _beam}), do: Order.name(name)

  defp mission?({name, beam}), do: ObjectCode.read(name, beam) == {:ok, true}

  @doc "The object code of all modules that may be replaced, from their files, before these change."
  @spec keep() :: store()
  def keep do
    for app <- apps(),
        module <- Application.spec(app, :modules) || [],
        {^module, beam, _file} <- [:code.get_object_code(module)],
        into: %{},
        do: {module, beam}
  end

  defp apps, do: Missions.apps() -- @carrying

  @doc "Loads the missions' modules again from their files where other code is loaded; what was kept is not known."
  @spec revert() :: :ok
  def revert do
    for {module, beam} <- keep(), :erlang.module_loaded(module), same(module, beam) != beam do
      back(module, beam)
    end

    :ok
  end

  @doc """
  Checks the code of a signed order: the mission, its modules, and what is loaded of them now. `loaded` are
  the modules that earlier orders have brought.
  """
  @spec check(Order.t(), loaded :: store(), kept :: store()) ::
          {:ok, mission :: module(), [{module(), binary()}], earlier()}
          | {:error, line :: String.t()}
  def check(%Order{mission: name, code: []}, _loaded, _kept) do
    with {:ok, module} <- existing(name), true <- Robot.Mission.mission?(module) do
      {:ok, module, [], []}
    else
      _unknown -> {:error, "#{Order.name(name)} is not a mission of this build"}
    end
  end

  def check(%Order{mission: name, code: code}, loaded, kept) do
    with :ok <- below(name, code),
         :ok <- whole(name, code),
         modules = for({name, beam} <- code, do: {module(name), beam}),
         {:ok, earlier} <- earlier(modules, loaded, kept),
         do: {:ok, module(name), modules, earlier}
  end

  defp below(name, code) do
    case Enum.find(code, fn {other, _beam} ->
           other != name and not String.starts_with?(other, name <> ".")
         end) do
      nil -> :ok
      {other, _beam} -> {:error, "#{Order.name(other)} is not below #{Order.name(name)}"}
    end
  end

  # The names that the order gives are those of its bytes.
  defp whole(name, code) do
    wrong =
      Enum.find(code, fn {name, beam} ->
        ObjectCode.read(name, beam) == :error
      end)

    cond do
      wrong -> {:error, "the code of #{shown(wrong)} is not the object code of that module"}
      mission = List.keyfind(code, name, 0) -> declared(mission)
      true -> {:error, "the code of #{Order.name(name)} itself is missing"}
    end
  end

  defp declared(mission),
    do: if(mission?(mission), do: :ok, else: {:error, "#{shown(mission)} is not a Robot.Mission"})

  # Its object code, which bears this name, was read.
  defp module(name), do: String.to_existing_atom(name)

  defp existing(name) do
    {:ok, String.to_existing_atom(name)}
  rescue
    ArgumentError -> :error
  end

  defp earlier(modules, loaded, kept) do
    apps = apps()

    Enum.reduce_while(modules, {:ok, []}, fn {module, _beam}, {:ok, earlier} ->
      case before(module, loaded, kept, apps) do
        {:error, line} -> {:halt, {:error, line}}
        before -> {:cont, {:ok, [{module, before} | earlier]}}
      end
    end)
  end

  defp before(module, loaded, kept, apps) do
    app = Application.get_application(module)

    cond do
      beam = loaded[module] ->
        beam

      app in apps and is_map_key(kept, module) ->
        same(module, kept[module])

      app == nil and unknown?(module) ->
        :absent

      app == nil ->
        {:error, "#{inspect(module)} is loaded from no file of a mission's application"}

      true ->
        {:error, "#{inspect(module)} belongs to #{app}, which no order replaces"}
    end
  end

  defp unknown?(module),
    do: :code.which(module) == :non_existing and not :erlang.module_loaded(module)

  # What could not be brought back must not be replaced.
  defp same(module, beam) do
    {:ok, {^module, md5}} = :beam_lib.md5(beam)

    if not :erlang.module_loaded(module) or module.module_info(:md5) == md5,
      do: beam,
      else: {:error, "#{inspect(module)} runs here with other code than that of its file"}
  end

  @doc "Loads modules, all or none. Old code must not be in use; code that runs at loading is refused."
  @spec load([{module(), binary()}]) :: :ok | {:error, line :: String.t()}
  def load(modules) do
    with nil <- Enum.find(modules, fn {module, _beam} -> not :code.soft_purge(module) end),
         :ok <- :code.atomic_load(for {m, beam} <- modules, do: {m, file(m), beam}) do
      :ok
    else
      {:error, [{module, why} | _]} ->
        {:error, "#{inspect(module)} cannot be loaded: #{inspect(why)}"}

      {module, _beam} ->
        {:error, "old code of #{inspect(module)} is still in use"}
    end
  end

  defp file(module) do
    case :code.which(module) do
      [_ | _] = file -> file
      _none -> ~c"replaced"
    end
  end

  @doc """
  Brings back what was loaded before. A robot that stands may still have what its mission has left: that
  stays valid until the next order for these modules.
  """
  @spec restore(earlier()) :: :ok
  def restore(earlier) do
    for {module, before} <- earlier, do: back(module, before)
    :ok
  end

  defp back(module, :absent) do
    :code.purge(module)
    :code.delete(module)
  end

  defp back(module, beam) do
    :code.purge(module)
    {:module, ^module} = :code.load_binary(module, file(module), beam)
  end
end
