defmodule Swarm.MissionRegistry do
  @moduledoc """
  Lists the missions for groups that this node knows, by name. They live in apps above this one, so the configuration
  lists them:

      config :swarm, missions: [landmark: Missions.Landmark, patrol: Missions.Patrol]

  A name reaches a mission everywhere: in `Swarm.start/2`, in a robot's file, in text commands
  (`start:patrol`), in `bin/demo --mission`. A module that declares `Robot.Mission` may stand where a
  name may. A robot that is told no mission starts that of its file, or else the first of the list.
  """
  alias Hal.Options
  alias Hal.Options.{Suggest, Type, Wording}
  alias Robot.File.Terms
  alias Robot.Mission
  alias Swarm.BehaviourRegistry

  @typedoc "How people name a mission: by its name, also as text, or by its module; with options or without."
  @type named ::
          atom() | String.t() | {atom() | String.t(), keyword()} | {module(), keyword()}

  @doc """
  The mission of this name, which may be text or a module; an error is one line that suggests what
  may have been meant.
  """
  @spec fetch(atom() | String.t()) :: {:ok, module()} | {:error, line :: String.t()}
  def fetch(name) do
    known = known()

    case Enum.find(known, fn {key, _module} -> key == name or Atom.to_string(key) == name end) do
      {_name, module} ->
        loaded(module)

      nil ->
        if is_atom(name) and name != nil and Mission.mission?(name),
          do: {:ok, name},
          else: unknown(name, known)
    end
  end

  defp unknown(name, known) do
    shown = Wording.show(name)
    # In the caller's notation.
    names = if is_binary(name), do: names(), else: Keyword.keys(known)
    {:error, "mission #{shown} is not known; #{allowed(names)}#{hint(name, shown, names)}"}
  end

  defp hint(name, shown, names) do
    if to_string(name) in BehaviourRegistry.names(),
      do: "; #{name} is a behaviour: run:#{name}",
      else: Suggest.hint(shown, names)
  end

  @doc "The names of all missions, in their order."
  @spec names() :: [String.t()]
  def names, do: Enum.map(known(), fn {name, _module} -> Atom.to_string(name) end)

  @doc "The phases of all missions (`c:Robot.Mission.phases/0`)."
  @spec phases() :: [atom()]
  def phases,
    do: for({_name, module} <- known(), phase <- Mission.phases(module), uniq: true, do: phase)

  @doc "The missions that hear messages of people, by name, with the kinds of these and their tables (`Robot.Mission.Letter.of_people/1`)."
  @spec messages() :: [{name :: String.t(), [{kind :: atom(), Options.table()}, ...]}]
  def messages do
    for {name, module} <- known(),
        {:ok, module} <- [loaded(module)],
        [_ | _] = kinds <- [Mission.Letter.of_people(module)],
        do: {Atom.to_string(name), kinds}
  end

  @doc "What people call a mission: its name, or its module if it has none."
  @spec name(module()) :: String.t()
  def name(module) do
    case List.keyfind(known(), module, 1) do
      {name, ^module} -> Atom.to_string(name)
      nil -> inspect(module)
    end
  end

  @doc """
  The module of a mission that people have named, and its checked options. `robots` is how many start
  together, `nil` if that is not known. The error is one line.
  """
  @spec choose(named() | term(), robots :: pos_integer() | nil) ::
          {:ok, {module(), keyword()}} | {:error, line :: String.t()}
  def choose({name, options}, robots) when is_atom(name) or is_binary(name) do
    with {:ok, module} <- fetch(name),
         {:keys, true} <- {:keys, Keyword.keyword?(options)},
         {:ok, options} <- options(module, options, robots) do
      {:ok, {module, options}}
    else
      {:keys, false} -> {:error, "mission #{said(name)} options: #{not_keys(options)}"}
      error -> error
    end
  end

  def choose(name, robots) when is_atom(name) or is_binary(name), do: choose({name, []}, robots)

  def choose(other, _robots) do
    {:error, "mission: expected a name, or {name, [key: value, …]}, got #{Wording.show(other)}"}
  end

  defp not_keys(options) do
    {:error, [{[], text}]} = Wording.refuse("[key: value, …]", options)
    text
  end

  @doc """
  A mission as robot files and other Elixir terms name it, for tables of `Hal.Options`: `nil`, a name,
  or a name or module with options, `{:patrol, period: 90}`, `{:patrol, [period: 90]}`. It asks all missions for their
  options, so that the names of the options exist as atoms even for a reader that creates none.
  """
  @spec type() :: Type.t()
  def type do
    known = known()
    Enum.each(known, fn {_name, module} -> option_table(module) || options(module, [], nil) end)

    if known == [],
      do: {:check, &named?/1, "nil (#{allowed([])})"},
      else: {:check, &named?/1, "#{Enum.map_join(known, ", ", &inspect(elem(&1, 0)))} or nil"}
  end

  defp named?(nil), do: true

  defp named?({name, options} = named) when is_atom(name) and name != nil do
    case fetch(name) do
      {:ok, module} -> within(option_table(module), named, options)
      {:error, _line} -> refuse(name)
    end
  end

  defp named?({name, _options}), do: refuse(name)

  defp named?(name) do
    known? = is_atom(name) and (Keyword.has_key?(known(), name) or Mission.mission?(name))
    if known?, do: true, else: refuse(name)
  end

  defp within([_ | _] = table, named, options),
    do:
      with({:ok, read} <- Type.read({:keys, table}, options), do: {:ok, put_elem(named, 1, read)})

  defp within(_no_table, named, options) do
    case Terms.strange(options) do
      nil -> with {:ok, _checked} <- choose(named, nil), do: true
      name -> Wording.refuse("a name that this build knows", name)
    end
  end

  # A name that is no atom, as a robot file has it, is shown as it was written.
  defp refuse(name) do
    {:error, [{[], text}]} = Wording.refuse({:one_of, [nil | Keyword.keys(known())]}, name)
    {:error, text}
  end

  @doc """
  The options of a mission as a table (`c:Robot.Mission.option_table/0`); `nil` if
  the mission does not define them.
  """
  @spec option_table(module()) :: Options.table() | nil
  def option_table(module) do
    if Code.ensure_loaded?(module) and function_exported?(module, :option_table, 0),
      do: module.option_table()
  end

  @doc "The mission of a robot whose file names none."
  @spec default() :: {:ok, module()} | {:error, line :: String.t()}
  def default do
    case known() do
      [{_name, module} | _] -> loaded(module)
      [] -> {:error, allowed([])}
    end
  end

  @doc """
  Checks the options of a start by the mission (`Robot.Mission.check_options/3`). `robots` is how many
  start together, `nil` if that is not known.
  """
  @spec options(module(), keyword(), pos_integer() | nil) ::
          {:ok, keyword()} | {:error, line :: String.t()}
  def options(module, options, robots) do
    if Code.ensure_loaded?(module),
      do: Mission.check_options(module, options, robots),
      else: {:error, "#{inspect(module)} is not part of this build"}
  end

  @doc """
  Loads all modules of an app, of the missions' apps, and of those that they depend on (`parts/1`). Without a release the VM
  loads each at its first call, and the atoms in it are unknown until then.
  """
  @spec load(app :: atom()) :: :ok
  def load(app \\ :swarm) do
    modules =
      for app <- parts([app | apps()]),
          module <- Application.spec(app, :modules) || [],
          do: module

    # Together, because the VM then brings them in at once, in a quarter of the time.
    :code.ensure_modules_loaded(modules)
  end

  @doc """
  These applications and all that they depend on, each behind its own; only those that stand on `hal`, as all that know
  robots do.

      iex> Swarm.MissionRegistry.parts([:robot, :stdlib])
      [:hal, :nav, :vision, :robot]
  """
  @spec parts([atom()]) :: [atom()]
  def parts(apps), do: Enum.reduce(apps, [], &part/2)

  defp part(app, found) do
    _loaded_or_not = Application.load(app)
    below = app |> Application.spec(:applications) |> List.wrap() |> parts()
    own = if app == :hal or :hal in below, do: below ++ [app], else: []
    found ++ (own -- found)
  end

  @doc "The applications that contain these missions, loaded."
  @spec apps() :: [atom()]
  def apps do
    for {_name, module} <- known(), {:ok, module} <- [loaded(module)], uniq: true do
      Application.get_application(module) || load_app(:code.which(module)) || :swarm
    end
  end

  # A node that was not started as a release loads no application that is not started.
  defp load_app(beam) when is_list(beam) do
    with [file] <- beam |> Path.dirname() |> Path.join("*.app") |> Path.wildcard(),
         {:ok, [{:application, app, _keys} = spec]} <- :file.consult(file),
         :ok <- :application.load(spec),
         do: app,
         else: (_none -> nil)
  end

  defp load_app(_defined_without_file), do: nil

  defp known, do: Application.get_env(:swarm, :missions, [])

  defp loaded(module) do
    if Code.ensure_loaded?(module),
      do: {:ok, module},
      else: {:error, "mission #{inspect(module)} is configured, but not part of this release"}
  end

  defp allowed([]), do: "no mission is configured (config :swarm, missions: …)"

  defp allowed([name]), do: "expected #{said(name)}"
  defp allowed(names), do: "expected one of #{Enum.map_join(names, ", ", &said/1)}"

  defp said(name), do: if(is_binary(name), do: name, else: inspect(name))
end
