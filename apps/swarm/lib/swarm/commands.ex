defmodule Swarm.Commands do
  @moduledoc false
  # The helpers of `Swarm`: which robots are meant, what is allowed, and what they answer.
  alias Hal.Options
  alias Hal.Options.Suggest
  alias Swarm.{Formation, MissionRegistry}
  alias Swarm.{Commands, Transport}

  @doc "The ids of the given robots if all exist; the error is one line."
  @spec robots(term()) :: {:ok, [atom(), ...]} | {:error, String.t()}
  def robots(:all) do
    case Transport.robots() do
      [] -> {:error, "there are no robots here"}
      robots -> {:ok, robots}
    end
  end

  def robots([]), do: {:error, "[] does not name a robot; write a name, a list of names or :all"}

  def robots(names) when is_list(names) do
    known = Transport.robots()

    with false <- List.improper?(names),
         {:ok, ids} <- named(names, known) do
      {:ok, Enum.uniq(ids)}
    else
      true -> {:error, "#{inspect(names)} is not a list of robots"}
      error -> error
    end
  end

  def robots(name), do: robots([name])

  defp named(names, known) do
    Enum.reduce_while(names, {:ok, []}, fn name, {:ok, ids} ->
      case Enum.find(known, &(&1 == name or Atom.to_string(&1) == name)) do
        nil -> {:halt, {:error, unknown(name, known)}}
        id -> {:cont, {:ok, ids ++ [id]}}
      end
    end)
  end

  defp unknown(name, known) do
    there = if known == [], do: "none", else: Enum.join(known, ", ")
    word = if is_binary(name), do: name, else: String.trim_leading(inspect(name), ":")

    "no robot #{inspect(name)}; there are #{there}" <>
      Suggest.hint(word, Enum.map(known, &Atom.to_string/1))
  end

  @doc """
  Checks a start: which mission (`nil`: that of each robot's file), which robots take part, and the
  options of the mission. Returns the request for these robots.
  """
  @spec start(term(), term()) :: {:ok, [atom()], request :: tuple()} | {:error, String.t()}
  def start(mission, options) do
    with {:ok, options} <- keyword(options),
         {:ok, robots} <- robots(Keyword.get(options, :robots, :all)),
         {:ok, request} <- request(mission, Keyword.delete(options, :robots), length(robots)),
         do: {:ok, robots, request}
  end

  defp request(nil, options, count) do
    with {:ok, mission} <- MissionRegistry.default(),
         {:ok, options} <- MissionRegistry.options(mission, options, count),
         do: {:ok, {:start, options}}
  end

  defp request(mission, options, count) do
    with {:ok, {module, options}} <- MissionRegistry.choose({mission, options}, count),
         do: {:ok, {:start, module, options}}
  end

  defp keyword(options) do
    if Keyword.keyword?(options),
      do: {:ok, options},
      else:
        Options.refuse(
          "start",
          [],
          options,
          "[key: value, …] with robots, and those of the mission,"
        )
  end

  @doc "Checks a formation."
  @spec formation(term(), term(), pos_integer() | nil) ::
          {:ok, Formation.t()} | {:error, String.t()}
  def formation(kind, options, robots \\ nil) do
    Formation.new(kind, fleet(options, robots || length(Transport.robots())))
  end

  @doc """
  Sends a command to the robots; `:ok` when all accept, or `{:ok, line}` with their answers, else
  one line about those that do not accept, with the answers of the others.
  """
  @spec tell([atom()], term()) :: Swarm.answer() | {:ok, line :: String.t()}
  def tell(robots, request), do: told(robots, Commands.Client.ask(robots, request))

  @doc "The same in words, by the answers of the robots."
  @spec told([atom()], %{atom() => term()}) :: Swarm.answer() | {:ok, line :: String.t()}
  def told(robots, answers) do
    said = for id <- robots, {:ok, line} <- [answers[id]], do: line
    refusals = for {_id, line} <- Commands.Client.refusals(robots, answers), do: line

    case {refusals, said} do
      {[], []} -> :ok
      {[], said} -> {:ok, Enum.join(said, "; ")}
      {refusals, said} -> {:error, (refusals ++ said) |> Enum.uniq() |> Enum.join("; ")}
    end
  end

  @doc """
  The same for a command that only robots on a mission can accept: a robot without a mission does
  not count as refusing if another has one. A robot that does not answer may be the leader, so it
  is named.
  """
  @spec any([atom()], term()) :: Swarm.answer()
  def any(robots, request), do: any_told(robots, Commands.Client.ask(robots, request))

  @doc "The same in words, by the answers of the robots."
  @spec any_told([atom()], %{atom() => term()}) :: Swarm.answer()
  def any_told(robots, answers) do
    {taken, others} = Enum.split_with(robots, &(answers[&1] == :ok))
    others = Enum.reject(others, &(answers[&1] == {:error, :no_formation}))
    lines = Enum.uniq(for {_id, line} <- Commands.Client.refusals(others, answers), do: line)

    case {taken, lines} do
      {[_ | _], []} -> :ok
      {[], []} -> {:error, "no robot is on a mission that has a formation; start it first"}
      {[], lines} -> {:error, Enum.join(lines, "; ")}
      {_taken, lines} -> {:error, Enum.join(lines ++ ["the others accepted it"], "; ")}
    end
  end

  # The number of robots matters only for a whole length or side.
  defp fleet(options, robots) do
    if Keyword.keyword?(options) and (options[:length] || options[:side]) != nil,
      do: options ++ [robots: robots],
      else: options
  end
end
