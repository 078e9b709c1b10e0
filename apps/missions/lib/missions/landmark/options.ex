defmodule Missions.Landmark.Options do
  @moduledoc """
  Checks and completes the options of the landmark mission. Pure.

  | option | meaning | default |
  |---|---|---|
  | `formation:` | `{kind, spacing}` or a kind (`Swarm.Formation`) | `{:column, 1.0}` |
  | `formations:` | what a mark's id makes of the formation, `[{3, :line}, {4, {:circle, 1.5}}]` (`Missions.Landmark.Signs`) | none |
  | `assign:` | `:chain` or `:cost` | `:chain` |
  | `leader_change:` | whether a robot that is nearer takes over | `true` |
  | `colour:` | the landmark's colour, by its name in the colour file | the landmark's |
  | `policy:`, `of:`, `lost_link:` | see `Missions.Landmark.Policy` | `:available` |
  """
  alias Hal.Options
  alias Swarm.Formation

  @doc "The table of the options: what is allowed."
  @spec table() :: Options.table()
  def table do
    [
      formation: Formation.type(),
      formations: {:list, {:tuple, [{:integer, 0, 65_535}, Formation.type()], "{3, :line}"}},
      assign: {:one_of, [:chain, :cost]},
      leader_change: :boolean,
      colour: {:text, "the name of a colour, in quotes,"},
      policy: {:one_of, [:available, :majority]},
      of: [{:integer, 1, 1_000, "robots of the fleet"}, default: nil],
      lost_link: [{:one_of, [:stop, :hold, :continue]}, default: nil]
    ]
  end

  @doc """
  Checks and completes options as people write them, for a start of so many robots (`nil` if that
  is not known). Options that were already checked pass unchanged.

      iex> Missions.Landmark.Options.check([formation: :wedge, policy: :majority], 4)
      {:ok, [of: 4, formation: {:wedge, 1.0}, policy: :majority]}
      iex> Missions.Landmark.Options.check([formations: [{3, :line}]], 4)
      {:ok, [formations: [{3, {:line, 1.0}}]]}
      iex> Missions.Landmark.Options.check([assign: :luck], 4)
      {:error, "landmark option assign: expected :chain or :cost, got :luck"}
      iex> Missions.Landmark.Options.check([policy: :majority], nil)
      {:error, "landmark option of is missing: policy :majority needs the number of robots of the fleet, 1 to 1000"}
  """
  @spec check(keyword(), robots :: pos_integer() | nil) ::
          {:ok, keyword()} | {:error, line :: String.t()}
  def check(options, robots) do
    with {:ok, checked} <- Options.check(options, table(), "landmark") do
      given =
        for {key, _value} = option <- checked,
            Enum.any?(options, fn {name, _} -> to_string(name) == to_string(key) end),
            do: option

      case {given[:policy], given[:of] || robots} do
        {:majority, nil} -> {:error, missing()}
        {:majority, of} -> {:ok, Keyword.put(given, :of, of)}
        _available -> {:ok, given}
      end
    end
  end

  defp missing,
    do:
      "landmark option of is missing: policy :majority needs the number of robots of the fleet, 1 to 1000"
end
