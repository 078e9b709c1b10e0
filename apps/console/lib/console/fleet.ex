defmodule Console.Fleet do
  @moduledoc """
  Reads a fleet and its formation, and names its robots: `mag1`, `mag2`, … (Magellan Pro) and `min1`, `min2`, … (ATRV mini). Pure.
  """

  alias Hal.Cli.Parse
  alias Swarm.Formation

  @most 1_000

  @doc """
  A fleet of `count` robots, half of each kind, one more Magellan when the count is odd.

      iex> Console.Fleet.of(3)
      [:mag1, :mag2, :min1]
  """
  @spec of(1..1_000) :: [atom()]
  def of(count) when count in 1..@most do
    mini = div(count, 2)
    names("mag", count - mini) ++ names("min", mini)
  end

  @doc """
  Parses a fleet.

      iex> Console.Fleet.parse("mag:2,min:1")
      {:ok, [:mag1, :mag2, :min1]}
      iex> Console.Fleet.parse("dog:2")
      {:error, "such as mag:4,min:2 (kinds mag and min), 1 to 1000 robots together"}
  """
  @spec parse(String.t()) :: {:ok, [atom()]} | {:error, String.t()}
  def parse(text) do
    parts = text |> String.split(",") |> Enum.map(&String.split(&1, ":"))
    kinds = for [kind, _count] <- parts, do: kind

    counts = for [_kind, count] <- parts, {:ok, n} <- [Parse.whole(count, 0..@most)], do: n

    if length(counts) == length(parts) and kinds -- ["mag", "min"] == [] and
         Enum.sum(counts) in 1..@most do
      {:ok, kinds |> Enum.zip(counts) |> Enum.sort() |> Enum.flat_map(&names/1)}
    else
      {:error, "such as mag:4,min:2 (kinds mag and min), 1 to #{@most} robots together"}
    end
  end

  @doc """
  A fleet's names in one line, as people write them.

      iex> Console.Fleet.describe([:mag1, :mag2, :mag3, :min1])
      "mag1 to mag3, min1"
  """
  @spec describe([atom()]) :: String.t()
  def describe(robots) do
    robots
    |> Enum.map(&Atom.to_string/1)
    |> Enum.chunk_by(&String.slice(&1, 0, 3))
    |> Enum.map_join(", ", fn
      [only] -> only
      names -> "#{hd(names)} to #{List.last(names)}"
    end)
  end

  defp names({kind, count}), do: names(kind, count)

  # At most a thousand names of each kind exist, so these atoms are bounded.
  defp names(kind, count), do: for(k <- 1..count//1, do: :"#{kind}#{k}")

  @doc "The formations by name."
  @spec formations() :: [String.t()]
  def formations, do: Enum.map(Formation.kinds(), &Atom.to_string/1)

  @doc """
  A formation and its spacing in metres, `KIND[:SPACING]`.

      iex> Console.Fleet.formation("wedge:1.2")
      {:ok, {:wedge, 1.2}}
      iex> Console.Fleet.formation("column")
      {:ok, {:column, 1.0}}
  """
  @spec formation(String.t()) ::
          {:ok, {atom(), float()}} | {:error, Hal.Cli.Arguments.allowed()}
  def formation(text) do
    {kind, spacing} =
      case String.split(text, ":", parts: 2) do
        [kind] -> {kind, "1.0"}
        [kind, spacing] -> {kind, spacing}
      end

    known = Enum.find(Formation.kinds(), &(Atom.to_string(&1) == kind))

    with {:kind, true} <- {:kind, known != nil},
         {:ok, spacing} <- Parse.number(spacing, 0.8, 5.0) do
      {:ok, {known, spacing}}
    else
      {:kind, false} ->
        {:error, {Parse.either(formations()), Hal.Options.Suggest.hint(kind, formations())}}

      {:error, _} ->
        {:error, "KIND:SPACING with a spacing from 0.8 to 5 metres"}
    end
  end
end
