defmodule Swarm.MissionRegistry.Text do
  @moduledoc """
  Missions, and behaviours (`Swarm.BehaviourRegistry`), as people type them, `patrol` or `patrol:period=90,loop=square`: a name, and the options of its
  table (`c:Robot.Mission.option_table/0`). A value is a word (`square`, `on`), a number, `kind:number` (a formation's
  `wedge:1.2`), or Elixir's notation (`[{1,2},{3,4}]`). Pure; no text becomes an atom.
  """
  alias Hal.Options
  alias Hal.Options.{Suggest, Type}
  alias Robot.File.{Reader, Terms}
  alias Robot.Mission.Letter
  alias Swarm.{BehaviourRegistry, MissionRegistry}

  @doc """
  The module of a mission and its checked options; `robots` is how many start together, `nil` if that
  is not known. The error is one line.
  """
  @spec read(String.t(), robots :: pos_integer() | nil) ::
          {:ok, {module(), keyword()}} | {:error, line :: String.t()}
  def read(text, robots) do
    {name, options} = split(text)

    with {:ok, module} <- MissionRegistry.fetch(name),
         {:ok, options} <-
           options(MissionRegistry.name(module), MissionRegistry.option_table(module), options),
         {:ok, options} <- MissionRegistry.options(module, options, robots),
         do: {:ok, {module, options}}
  end

  @doc """
  The request of a text command (`Robot.Command`): a start that names its mission in words becomes
  `{:start, module, options}`, a run of a behaviour `{:run, module, options}`; any other stays as it is.
  """
  @spec request(Robot.Command.t(), robots :: pos_integer() | nil) ::
          {:ok, term()} | {:error, line :: String.t()}
  def request({:start, text}, robots) do
    with {:ok, {module, options}} <- read(text, robots), do: {:ok, {:start, module, options}}
  end

  def request({:run, text}, _robots) do
    {name, options} = split(text)

    with {:ok, module} <- BehaviourRegistry.fetch(name),
         table = MissionRegistry.option_table(module),
         {:ok, options} <- options(BehaviourRegistry.name(module), table, options),
         {:ok, {module, options}} <- BehaviourRegistry.choose(module, options),
         do: {:ok, {:run, module, options}}
  end

  def request(command, _robots), do: {:ok, command}

  @doc """
  The message of a person, `leg:leg=3`, to the mission that a robot runs, by what its board has of that: its kind, and its fields
  as the mission's table has them (`Robot.Mission.Letter.of_people/1`). The error is one line that names the field and what is allowed.
  """
  @spec message(
          {:ok, %{state: Robot.Mission.Runner.state()}, at_ms :: integer()} | :error,
          String.t()
        ) ::
          {:ok, {:message, module(), kind :: atom(), fields :: keyword()}}
          | {:error, line :: String.t()}
  def message({:ok, %{state: {mission, _phase}}, _at_ms}, text) do
    {word, fields} = split(text)
    kinds = Letter.of_people(mission)

    case Enum.find(kinds, fn {kind, _table} -> Atom.to_string(kind) == word end) do
      {kind, table} ->
        with {:ok, fields} <- options(word, table, fields),
             {:ok, fields} <- Options.check(fields, table, "message #{word}"),
             do: {:ok, {:message, mission, kind, fields}}

      nil ->
        unheard(MissionRegistry.name(mission), word, for({kind, _table} <- kinds, do: "#{kind}"))
    end
  end

  def message(_idle, _text),
    do: {:error, "it has no mission that could hear a message; start it first"}

  defp unheard(mission, _word, []), do: {:error, "#{mission} hears no messages of people"}

  defp unheard(mission, word, kinds) do
    {:error,
     "#{mission} hears of people #{Enum.join(kinds, ", ")}, not #{inspect(word)}#{Suggest.hint(word, kinds)}"}
  end

  defp split(text) do
    case String.split(text, ":", parts: 2) do
      [name] -> {String.trim(name), ""}
      [name, options] -> {String.trim(name), String.trim(options)}
    end
  end

  defp options(_name, _table, ""), do: {:ok, []}
  defp options(name, nil, _text), do: {:error, "#{name} takes no options as text"}

  defp options(name, table, text) do
    pairs = text |> parts() |> Enum.map(&pair(&1, table))

    case Enum.find(pairs, &is_binary/1) || Enum.find_value(pairs, &joined(&1, table)) do
      nil -> {:ok, pairs}
      wrong -> {:error, "#{name}: #{fault(wrong)}"}
    end
  end

  defp fault({sign, next}),
    do: "options are separated by a comma, not by #{inspect(sign)}: …,#{next}=…"

  defp fault(wrong), do: "expected KEY=VALUE,…, got #{inspect(wrong)}"

  # A value that its type refuses, and in which another option begins.
  defp joined({key, value}, table) when is_atom(key) and is_binary(value) do
    with {:error, _problems} <- table[key] |> List.wrap() |> hd() |> Type.read(value),
         [_, sign, next] <- Regex.run(~r/\s*([:;&+|]|\s)\s*([a-z_]\w*)\s*=/, value),
         true <- Enum.any?(table, fn {name, _type} -> Atom.to_string(name) == next end),
         do: {sign, next},
         else: (_none -> nil)
  end

  defp joined(_pair, _table), do: nil

  defp pair(part, table) do
    case String.split(part, "=", parts: 2) do
      [key, value] -> key |> String.trim() |> keyed(String.trim(value), table)
      _no_value -> part
    end
  end

  # An unknown key stays text, for `Hal.Options` to name.
  defp keyed(key, value, table) do
    case Enum.find(table, fn {name, _type} -> Atom.to_string(name) == key end) do
      {name, type} -> {name, value(value, hd(List.wrap(type)))}
      nil -> {key, value}
    end
  end

  # What the type accepts first; else what it refuses is shown as it was understood.
  defp value(text, type) do
    candidates = [term(text), text]
    Enum.find(candidates, hd(candidates), &match?({:ok, _value}, Type.read(type, &1)))
  end

  defp term("on"), do: true
  defp term("off"), do: false

  defp term(text) do
    with {:ok, {_line, {:list, [node]}}} <- Reader.read("[" <> notation(text) <> "]", "value"),
         term = Terms.term(node),
         nil <- Terms.strange(term) do
      term
    else
      _no_term -> text
    end
  end

  @word ~S"[a-z_]\w*"

  defp notation(text) do
    cond do
      text in ["true", "false", "nil"] -> text
      text =~ ~r/\A#{@word}\z/ -> ":" <> text
      text =~ ~r/\A#{@word}:[^:]+\z/ -> "{:" <> String.replace(text, ":", ", ") <> "}"
      true -> text
    end
  end

  # At commas that are in no brackets and no quotes.
  defp parts(text) do
    ~r/(?:\[[^\]]*\]|\{[^}]*\}|"[^"]*"|[^,])+/
    |> Regex.scan(text)
    |> Enum.map(fn [part] -> part end)
  end
end
