defmodule Robot.Mission.Claim do
  @moduledoc """
  Describes what a mission says of itself to all other robots, five times a second, with their heartbeats. Pure.

  A mission names a struct for it (`c:Robot.Mission.claims/0`); the fields' values come from its
  effect `{:claim, map}`, or are the struct's defaults. Robots with the same version of the mission hear them; all others
  hear the robot's body alone.
  """
  alias Robot.Mission

  # A mission that has decided nothing for so long may have been frozen.
  @stale_ms 1_000
  @latest 65_535

  @enforce_keys [:mission, :version, :fields]
  defstruct @enforce_keys

  @type t :: %__MODULE__{mission: module(), version: 1..65_535, fields: struct()}

  @doc "What others hear of what this mission claims; `nil` of one that has nothing more to say."
  @spec new(module() | nil, claim :: map()) :: t() | nil
  def new(mission, claim) do
    with true <- loaded?(mission),
         {version, said} <- claims(mission) do
      %__MODULE__{mission: mission, version: version, fields: struct(said, claim)}
    else
      _nothing_more -> nil
    end
  end

  @doc """
  What is wrong with what a mission names for its claims: others could not check it. `nil` if nothing is.

      iex> Robot.Mission.Claim.fault(Robot.Mission.Manual)
      nil
  """
  @spec fault(module()) :: String.t() | nil
  def fault(mission) do
    case claims(mission) do
      nil -> nil
      {version, said} when version in 1..@latest and is_atom(said) -> struct_fault(said)
      other -> "claims/0: expected {version, module of a struct}, got #{inspect(other)}"
    end
  end

  defp struct_fault(said) do
    cond do
      not loaded?(said) or not function_exported?(said, :__struct__, 0) ->
        "claims #{inspect(said)}, which is no struct of this build"

      not function_exported?(said, :valid?, 1) ->
        "claims #{inspect(said)}, which lacks valid?/1: whether one from outside makes sense"

      true ->
        nil
    end
  end

  @doc """
  What a claim from outside is worth: itself, if its mission's own checks allow it; `nil`, if this build has no such mission or
  another version of it.

      iex> claim = %Robot.Mission.Claim{mission: Some.Mission, version: 1, fields: %{}}
      iex> for term <- [nil, claim, %{claim | version: 0}, %{claim | fields: []}, :junk],
      ...>   do: Robot.Mission.Claim.check(term)
      [{:ok, nil}, {:ok, nil}, :error, :error, :error]
  """
  @spec check(term()) :: {:ok, t() | nil} | :error
  def check(nil), do: {:ok, nil}

  def check(%{__struct__: __MODULE__, mission: mission, version: version, fields: fields} = claim)
      when map_size(claim) == 4 and is_atom(mission) and version in 1..@latest and is_map(fields) do
    case claims(mission) do
      {^version, said} -> if fits?(fields, said), do: {:ok, claim}, else: :error
      _unknown -> {:ok, nil}
    end
  end

  def check(_term), do: :error

  # Of this struct, with all of its keys and no others.
  defp fits?(%{__struct__: said} = fields, said) do
    whole = said.__struct__()

    map_size(fields) == map_size(whole) and
      Enum.all?(Map.keys(whole), &is_map_key(fields, &1)) and
      said.valid?(fields)
  end

  defp fits?(_fields, _said), do: false

  @doc """
  What a mission may still claim that claimed this so long ago: it may have been frozen or hung, and what it says before it has
  looked at the clock must not contradict what others have decided meanwhile (`c:Robot.Mission.stale/1`).
  """
  @spec timely(module(), claim :: map(), age_ms :: integer()) :: map()
  def timely(mission, claim, age_ms) do
    if age_ms > @stale_ms and loaded?(mission) and function_exported?(mission, :stale, 1),
      do: mission.stale(claim),
      else: claim
  end

  # A mission from outside is not loaded for that: a sender of invented names would keep the code server busy.
  defp loaded?(nil), do: false
  defp loaded?(mission), do: Code.ensure_loaded?(mission)

  @spec claims(module()) :: Mission.claims() | nil
  defp claims(mission), do: if(function_exported?(mission, :claims, 0), do: mission.claims())
end
