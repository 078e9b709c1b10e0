defmodule Robot.Mission.Letter do
  @moduledoc """
  Carries a message of a mission's own kind, and checks what reaches a mission. Pure.

  A mission names the messages that it hears, with a table of `Hal.Options` for each kind of its own
  (`c:Robot.Mission.messages/0`). It says one by the effect `{:tell, to, kind, fields}`, and hears
  `{:message, %{from: robot, kind: kind, body: fields}}`: what comes from another mission or version, has
  another kind, or does not fit its table never reaches it, and is counted (`Robot.Mission.Runner`).
  """
  alias Hal.Options
  alias Robot.Mission

  # What one letter may take on the wire, in bytes.
  @most_bytes 8_000
  @latest 65_535

  @enforce_keys [:to, :mission, :version, :kind, :fields]
  defstruct @enforce_keys

  @typedoc "`to` are its addressees: a robot that hears it may forward it to them, and to no others."
  @type t :: %__MODULE__{
          to: :all | [atom()],
          mission: module(),
          version: 1..65_535,
          kind: atom(),
          fields: keyword()
        }

  @doc """
  A letter of this mission to one robot, to several, or to all. Raises `ArgumentError` if its own table does not allow
  it: that is the mission's fault, as an invalid goal is.
  """
  @spec new!(module(), to :: atom() | [atom()] | :all, kind :: atom(), fields :: keyword()) :: t()
  def new!(mission, to, kind, fields) do
    to = if to == :all, do: :all, else: List.wrap(to)
    {version, kinds} = messages(mission)

    case List.keyfind(kinds, kind, 0) do
      {^kind, table} when is_list(table) ->
        fields = Options.check!(fields, table, "message #{inspect(kind)}")
        %__MODULE__{to: to, mission: mission, version: version, kind: kind, fields: fields}

      _other ->
        raise ArgumentError, "#{inspect(mission)} has no message of its own #{inspect(kind)}"
    end
  end

  @doc """
  Whether a term from outside has the shape of a letter: no mission has looked at its fields yet.

      iex> letter = %Robot.Mission.Letter{to: :all, mission: Some.Mission, version: 1, kind: :seen, fields: [point: 3]}
      iex> for term <- [letter, %{letter | fields: [1]}, %{letter | version: 0}, %{letter | to: [:mag1 | :mag2]}, :junk],
      ...>   do: Robot.Mission.Letter.valid?(term)
      [true, false, false, false, false]
  """
  @spec valid?(term()) :: boolean()
  def valid?(%{__struct__: __MODULE__, mission: mission, version: version, kind: kind} = letter) do
    is_map_key(letter, :fields) and is_map_key(letter, :to) and map_size(letter) == 6 and
      name?(mission) and name?(kind) and version in 1..@latest and
      :erlang.external_size(letter) <= @most_bytes and Keyword.keyword?(letter.fields) and
      to?(letter.to)
  end

  def valid?(_other), do: false

  @doc """
  Whether a robot is among the addressees of a letter.

      iex> letter = %Robot.Mission.Letter{to: [:mag1], mission: Some.Mission, version: 1, kind: :seen, fields: []}
      iex> for robot <- [:mag1, :mag2], do: Robot.Mission.Letter.to?(letter, robot)
      [true, false]
  """
  @spec to?(t(), atom()) :: boolean()
  def to?(%__MODULE__{to: :all}, _robot), do: true
  def to?(%__MODULE__{to: robots}, robot), do: robot in robots

  defp to?(:all), do: true
  defp to?([]), do: true
  defp to?([robot | others]), do: name?(robot) and to?(others)
  defp to?(_other), do: false

  defp name?(term), do: is_atom(term) and term not in [nil, true, false]

  @doc """
  The message as its mission hears it, or `:refused`. A mission that names no messages hears those that
  all robots share (`Swarm.Message`), and must look at them itself.
  """
  @spec open(module(), message :: map()) :: {:ok, map()} | :refused
  def open(mission, %{body: %{__struct__: __MODULE__} = letter, from: from} = message) do
    {version, kinds} = messages(mission)

    with true <- name?(from) and valid?(letter),
         %{mission: ^mission, version: ^version, kind: kind, fields: fields} <- letter,
         {^kind, table} when is_list(table) <- List.keyfind(kinds, kind, 0),
         {:ok, fields} <- Options.check(fields, table, "message") do
      {:ok, %{message | kind: kind, body: fields}}
    else
      _not_ours -> :refused
    end
  end

  def open(mission, message) do
    cond do
      not function_exported?(mission, :messages, 0) -> {:ok, message}
      {Map.get(message, :kind), :shared} in elem(mission.messages(), 1) -> {:ok, message}
      true -> :refused
    end
  end

  @doc """
  The kinds of messages, with their tables, that people may write to a mission: those that it names among its commands, too
  (`c:Robot.Mission.commands/0`).

      iex> Robot.Mission.Letter.of_people(Robot.Mission.Manual)
      []
  """
  @spec of_people(module()) :: [{kind :: atom(), Options.table()}]
  def of_people(mission) do
    {_version, kinds} = messages(mission)
    for {kind, table} <- kinds, is_list(table), Mission.names?(mission, kind), do: {kind, table}
  end

  @doc "The version and the messages of a mission."
  @spec messages(module()) :: Mission.messages()
  def messages(mission),
    do: if(function_exported?(mission, :messages, 0), do: mission.messages(), else: {1, []})
end
