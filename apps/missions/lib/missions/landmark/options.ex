defmodule Missions.Landmark.Options do
  @moduledoc """
  The options of the landmark mission, checked and completed. Pure.

  | option | is | default |
  |---|---|---|
  | `formation:` | `{kind, spacing}` or a kind (`Swarm.Formation`) | `{:column, 1.0}` |
  | `assign:` | `:chain` or `:cost` | `:chain` |
  | `leader_change:` | whether a robot that is nearer takes over | `true` |
  | `colour:` | the landmark's colour, by its name in the colour file | the landmark's |
  | `policy:`, `of:`, `lost_link:` | see `Missions.Landmark.Policy` | `:available` |
  """
  alias Missions.Landmark.Policy
  alias Robot.Command
  alias Swarm.{Commands, Formation}

  @names ~w(formation assign leader_change colour policy of lost_link)

  @doc """
  Options as people write them, of a start of so many robots (`nil` where that is not known). What was checked
  once passes unchanged.

      iex> Missions.Landmark.Options.check([formation: :wedge, policy: :majority], 4)
      {:ok, [of: 4, formation: {:wedge, 1.0}, policy: :majority]}
      iex> Missions.Landmark.Options.check([assign: :luck], 4)
      {:error, "assign cannot be :luck: :chain or :cost"}
      iex> Missions.Landmark.Options.check([polcy: :majority], 4)
      {:error, "unknown option :polcy: formation, assign, leader_change, colour, policy, of, lost_link; did you mean policy?"}
  """
  @spec check(keyword(), robots :: pos_integer() | nil) ::
          {:ok, keyword()} | {:error, line :: String.t()}
  def check(options, robots) do
    with {:ok, options} <- each(options, robots),
         options = fleet_size(options, robots),
         {:ok, _policy} <- Policy.options(options),
         do: {:ok, options}
  end

  defp each(options, robots) do
    Enum.reduce_while(options, {:ok, []}, fn option, {:ok, checked} ->
      case option(option, robots) do
        {:ok, option} -> {:cont, {:ok, checked ++ [option]}}
        {:error, line} -> {:halt, {:error, line}}
      end
    end)
  end

  # A majority is one of those that are started, unless told otherwise.
  defp fleet_size(options, robots) do
    if options[:policy] == :majority and robots != nil,
      do: Keyword.put_new(options, :of, robots),
      else: options
  end

  defp option({:formation, {kind, spacing}}, robots),
    do: formation(Commands.formation(kind, [spacing: spacing], robots || 1))

  defp option({:formation, kind}, robots),
    do: formation(Commands.formation(kind, [], robots || 1))

  defp option({:assign, how} = option, _robots) when how in [:chain, :cost], do: {:ok, option}

  defp option({:assign, other}, _robots),
    do: {:error, "assign cannot be #{inspect(other)}: :chain or :cost"}

  defp option({:leader_change, on?} = option, _robots) when is_boolean(on?), do: {:ok, option}

  defp option({:leader_change, other}, _robots),
    do: {:error, "leader_change cannot be #{inspect(other)}: true or false"}

  defp option({:colour, name} = option, _robots) when is_binary(name), do: {:ok, option}

  defp option({:colour, other}, _robots),
    do: {:error, "colour cannot be #{inspect(other)}: the name of a colour, in quotes"}

  # Of `Policy`, which looks at them together.
  defp option({key, _value} = option, _robots) when key in [:policy, :of, :lost_link],
    do: {:ok, option}

  defp option({key, _value}, _robots),
    do: {:error, "unknown option #{inspect(key)}: #{Enum.join(@names, ", ")}" <> hint(key)}

  @spec formation({:ok, Formation.t()} | {:error, String.t()}) ::
          {:ok, {:formation, Formation.t()}} | {:error, String.t()}
  defp formation({:ok, formation}), do: {:ok, {:formation, formation}}
  defp formation({:error, line}), do: {:error, line}

  defp hint(key) do
    case Command.Arguments.nearest(Atom.to_string(key), @names) do
      nil -> ""
      near -> "; did you mean #{near}?"
    end
  end
end
