defmodule Sim.Trial.Options do
  @moduledoc "What a run may be asked for, with its defaults, checked. Pure."

  @defaults %{
    robots: [:mag1, :mag2, :mag3, :min1, :min2, :min3],
    seed: 1,
    map: "hall",
    start: :spread,
    landmark: :default,
    moves: [],
    kills: [],
    loss: 0.0,
    duplicates: 0.0,
    delay_ms: {5, 50},
    cuts: [],
    noise: :default,
    formation: {:column, 1.0},
    assign: :cost,
    leader_change: true,
    policy: :available,
    of: nil,
    lost_link: nil,
    duration_s: 120,
    blobs: :painted,
    hardware: []
  }

  @names Enum.sort(Map.keys(@defaults))
  @words %{
    start: [:spread, :same],
    noise: [:off, :default, :slip],
    assign: [:chain, :cost],
    leader_change: [true, false],
    policy: [:available, :majority],
    lost_link: [nil, :stop, :hold, :continue],
    blobs: [:painted, :direct]
  }

  @doc """
  All options, with the defaults where nothing was asked for; or one line that names what is wrong.

      iex> {:ok, options} = Sim.Trial.Options.check(robots: [:mag1], formation: :wedge)
      iex> {options.robots, options.formation, options.map}
      {[:mag1], {:wedge, 1.0}, "hall"}
      iex> Sim.Trial.Options.check(nois: :off)
      {:error, "unknown option :nois; did you mean :noise?"}
      iex> Sim.Trial.Options.check(robots: 12)
      {:error, "robots cannot be 12: a list of different names that begin with mag or min, [:mag1, :min1]"}
  """
  @spec check(keyword() | map()) :: {:ok, map()} | {:error, line :: String.t()}
  def check(asked) when is_map(asked), do: asked |> Map.to_list() |> check()

  def check(asked) do
    if Keyword.keyword?(asked),
      do: asked |> Enum.reduce_while({:ok, @defaults}, &take/2) |> cuts() |> hardware(),
      else: {:error, "options cannot be #{inspect(asked)}: [robots: [:mag1, :min1], seed: 3]"}
  end

  defp cuts({:ok, %{cuts: cuts, robots: robots}} = checked) do
    if Sim.Trial.Cuts.valid?(cuts, robots),
      do: checked,
      else:
        {:error,
         "cuts cannot be #{inspect(cuts)}: [{from_s, to_s, [[:mag1], [:mag2]]}] or " <>
           "[{from_s, :end, {:link, :mag1, :mag2}}], with robots of this run"}
  end

  defp cuts(error), do: error

  defp hardware({:ok, %{hardware: ids, robots: robots}} = checked) do
    if is_list(ids) and ids == Enum.uniq(ids) and ids -- robots == [],
      do: checked,
      else: {:error, "hardware cannot be #{inspect(ids)}: a list of robots of this run, [:mag1]"}
  end

  defp hardware(error), do: error

  defp take({name, _value}, _options) when name not in @names,
    do: {:halt, {:error, "unknown option #{inspect(name)}#{hint(name)}"}}

  defp take({name, value}, {:ok, options}) do
    case value(name, value) do
      {:ok, value} -> {:cont, {:ok, %{options | name => value}}}
      {:error, line} -> {:halt, {:error, line}}
      allowed -> {:halt, {:error, "#{name} cannot be #{inspect(value)}: #{allowed}"}}
    end
  end

  defp value(:robots, [_ | _] = robots) do
    if Enum.all?(robots, &robot?/1) and robots == Enum.uniq(robots),
      do: {:ok, robots},
      else: value(:robots, :wrong)
  end

  defp value(:robots, _other),
    do: "a list of different names that begin with mag or min, [:mag1, :min1]"

  defp value(:formation, {kind, spacing}), do: Swarm.Formation.new(kind, spacing: spacing)
  defp value(:formation, kind), do: Swarm.Formation.new(kind, [])
  defp value(:landmark, word) when word in [:default, :none], do: {:ok, word}
  defp value(:landmark, {x, y}) when is_number(x) and is_number(y), do: {:ok, {x, y}}
  defp value(:landmark, _other), do: "{x, y} in metres, :none or :default"
  defp value(:map, name) when is_binary(name), do: {:ok, name}
  defp value(:map, _other), do: ~s("hall", "hospital", "arena" or "FILE.png:WIDTHxHEIGHT")

  defp value(name, share)
       when name in [:loss, :duplicates] and is_number(share) and share >= 0 and share <= 1,
       do: {:ok, share}

  defp value(name, _other) when name in [:loss, :duplicates], do: "a share from 0 to 1"

  defp value(:delay_ms, {least, most})
       when is_integer(least) and is_integer(most) and least >= 0 and most >= least,
       do: {:ok, {least, most}}

  defp value(:delay_ms, _other), do: "{least, greatest} in whole milliseconds"
  defp value(:of, of) when of == nil or (is_integer(of) and of in 1..1_000), do: {:ok, of}
  defp value(:of, _other), do: "the number of robots of the fleet, 1 to 1000"
  defp value(:seed, seed) when is_integer(seed), do: {:ok, seed}
  defp value(:seed, _other), do: "a whole number"

  defp value(name, value) when is_map_key(@words, name) do
    if value in @words[name],
      do: {:ok, value},
      else: Enum.map_join(@words[name], " or ", &inspect/1)
  end

  defp value(_name, value), do: {:ok, value}

  defp robot?(id) when is_atom(id), do: String.starts_with?(Atom.to_string(id), ["mag", "min"])
  defp robot?(_other), do: false

  defp hint(name) do
    near = Enum.max_by(@names, &String.jaro_distance("#{&1}", "#{name}"))

    if String.jaro_distance("#{near}", "#{name}") > 0.77,
      do: "; did you mean #{inspect(near)}?",
      else: ": #{Enum.join(@names, ", ")}"
  end
end
