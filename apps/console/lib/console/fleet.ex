defmodule Console.Fleet do
  @moduledoc """
  Reads a fleet and its formation, and names its robots after their bodies: `mag1`, `burger1`, `burger2`, … Pure but for
  the names of bodies in `config/bodies`.
  """

  alias Hal.Cli.Parse
  alias Hal.Options.Suggest
  alias Hal.RobotName
  alias Robot.File.Bodies
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
    RobotName.numbered("mag", count - mini) ++ RobotName.numbered("min", mini)
  end

  @doc """
  Parses a fleet.

      iex> Console.Fleet.parse("mag:2,min:1")
      {:ok, [:mag1, :mag2, :min1]}
      iex> Console.Fleet.parse("create2:2,burger:1")
      {:ok, [:burger1, :create2_1, :create2_2]}
      iex> {:error, {allowed, hint}} = Console.Fleet.parse("buger:2")
      iex> {String.starts_with?(allowed, "such as burger:4,mag:2, with bodies burger, mag, min, "), hint}
      {true, "; did you mean burger?"}
  """
  @spec parse(String.t()) :: {:ok, [atom()]} | {:error, Hal.Cli.Arguments.allowed()}
  def parse(text) do
    parts = text |> String.split(",") |> Enum.map(&String.split(&1, ":"))
    kinds = for [kind | _count] <- parts, do: kind
    counts = for [_kind, count] <- parts, {:ok, n} <- [Parse.whole(count, 0..@most)], do: n
    known = Bodies.names()
    strange = Enum.find(kinds, &(&1 not in known))

    if length(counts) == length(parts) and strange == nil and kinds == Enum.uniq(kinds) and
         Enum.sum(counts) in 1..@most do
      named(kinds |> Enum.zip(counts) |> Enum.sort())
    else
      hint = if strange, do: Suggest.hint(strange, known), else: ""

      {:error,
       {"such as burger:4,mag:2, with bodies #{Enum.join(known, ", ")}, each once, and 1 to #{@most} robots together,",
        hint}}
    end
  end

  # At most a thousand, of bodies that there are, so these atoms are bounded.
  defp named(kinds) do
    names = Enum.flat_map(kinds, fn {kind, count} -> RobotName.numbered(kind, count) end)

    if Enum.all?(names, &RobotName.valid?/1),
      do: {:ok, names},
      else: {:error, "a body whose name leaves room for a number within 31 letters,"}
  end

  @doc """
  A fleet's names in one line, as people write them.

      iex> Console.Fleet.describe([:mag1, :mag2, :mag3, :min1])
      "mag1 to mag3, min1"
  """
  @spec describe([atom()]) :: String.t()
  def describe(robots) do
    robots
    |> Enum.chunk_by(&RobotName.kind/1)
    |> Enum.map_join(", ", fn
      [only] -> "#{only}"
      names -> "#{hd(names)} to #{List.last(names)}"
    end)
  end

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
        {:error, {Parse.either(formations()), Suggest.hint(kind, formations())}}

      {:error, _} ->
        {:error, "KIND:SPACING with a spacing from 0.8 to 5 metres"}
    end
  end
end
