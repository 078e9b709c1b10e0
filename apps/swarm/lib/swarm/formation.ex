defmodule Swarm.Formation do
  @moduledoc """
  Computes the places of robots in a formation, relative to the leader. Pure; metres and radians.

  A slot is a pose in the leader's frame (+x ahead, +y left); the leader has slot 0 and is not in
  the list. Slots have the leader's heading, except in a `:circle`, where all face its centre.

  | kind | slots |
  |---|---|
  | `:column` | one behind the other |
  | `:line` | abreast, left and right in turn |
  | `:wedge` | a V of 90 degrees, the leader at its tip |
  | `:triangle` | filled rows of 1, 2, 3, … |
  | `:diamond` | rows of 1, 2, …, m, …, 2, 1 |
  | `:circle` | a ring of all robots, the leader among them, around a point ahead of the leader |

  A build may add kinds of its own, each a `Swarm.Formation.Kind`, which its configuration names. All robots of a fleet
  must have the same ones.

      config :swarm, formations: [echelon: Mine.Echelon]
  """
  alias Hal.{Options, Pose}
  alias Hal.Options.{Type, Wording}

  @built_in [:column, :line, :wedge, :triangle, :diamond, :circle]
  @least_spacing 0.8
  @spacing {:number, @least_spacing, 5.0, "m"}
  @metres {:number, 0.0, 1_000.0, "m"}
  # The minimum radius of a ring: robots at that distance still see all of what stands in its centre.
  @least_ring 1.6

  @typedoc "One of the built-in kinds, or one that the build adds."
  @type kind :: :column | :line | :wedge | :triangle | :diamond | :circle | atom()
  @type t :: {kind(), spacing :: float()}

  @doc "All kinds: the built-in ones, then those that the build adds, if their modules exist."
  @spec kinds() :: [kind(), ...]
  def kinds, do: Enum.uniq(@built_in ++ for({kind, _module} <- added(), kind?(kind), do: kind))

  defp kind?(kind) when kind in @built_in, do: true
  defp kind?(kind) when not is_atom(kind), do: false

  defp kind?(kind) do
    case Keyword.fetch(added(), kind) do
      {:ok, module} -> Code.ensure_loaded?(module)
      :error -> false
    end
  end

  defp added, do: Application.get_env(:swarm, :formations, [])

  @doc """
  Whether a term from outside is a formation.

      iex> {Swarm.Formation.valid?({:wedge, 1.2}), Swarm.Formation.valid?({:wedge, :wide})}
      {true, false}
  """
  @spec valid?(term()) :: boolean()
  def valid?({kind, spacing}),
    do: kind?(kind) and is_float(spacing) and spacing >= @least_spacing and spacing < 100

  def valid?(_other), do: false

  @doc """
  Checks a formation. `length:` is the whole length of a line, `side:` the side of the triangle;
  both need the number of robots.

      iex> Swarm.Formation.new(:wedge, spacing: 1.2)
      {:ok, {:wedge, 1.2}}
      iex> Swarm.Formation.new(:line, length: 4.0, robots: 5)
      {:ok, {:line, 1.0}}
      iex> Swarm.Formation.new(:triangle, side: 3.0, robots: 6)
      {:ok, {:triangle, 1.5}}
      iex> Swarm.Formation.new(:column, spacing: 0.1)
      {:error, "column option spacing: expected a number from 0.8 to 5.0 m, got 0.1"}
      iex> {:error, line} = Swarm.Formation.new("hart", [])
      iex> line =~ ~s(formation: expected :column, :line, :wedge)
      true
  """
  @spec new(kind() | String.t() | term(), keyword()) :: {:ok, t()} | {:error, String.t()}
  def new(kind, options \\ []) do
    with {:kind, {:ok, kind}} <- {:kind, read_kind(kind)},
         {:ok, options} <- Options.check(options, allowed(kind), Atom.to_string(kind)),
         {:ok, spacing} <- Type.read(@spacing, spacing(kind, options)) do
      {:ok, {kind, spacing}}
    else
      {:kind, {:error, [{[], text}]}} -> {:error, "formation: #{text}"}
      {:error, [{[], text}]} -> {:error, "spacing: #{text}"}
      {:error, line} -> {:error, line}
    end
  end

  @doc "The type of a formation, `{kind, spacing}` or a kind (1 m), for a table of `Hal.Options`."
  @spec type() :: Type.t()
  def type, do: {:check, &read/1, "a formation"}

  defp read({kind, spacing}) do
    with {:ok, kind} <- read_kind(kind),
         {:ok, spacing} <- Type.read(@spacing, spacing),
         do: {:ok, {kind, spacing}}
  end

  defp read(kind), do: read({kind, 1.0})

  defp read_kind(kind) do
    case Enum.find(kinds(), &(&1 == kind or Atom.to_string(&1) == kind)) do
      nil -> Wording.refuse({:one_of, kinds()}, kind)
      kind -> {:ok, kind}
    end
  end

  defp allowed(:line), do: [{:length, @metres} | allowed(:column)]
  defp allowed(:triangle), do: [{:side, @metres} | allowed(:column)]
  defp allowed(_kind), do: [spacing: [@spacing, default: 1.0], robots: {:integer, 1, 1_000_000}]

  defp spacing(kind, options) do
    robots = options[:robots] || 2

    cond do
      kind == :line and is_number(options[:length]) -> options[:length] / max(robots - 1, 1)
      kind == :triangle and is_number(options[:side]) -> options[:side] / max(rows(robots) - 1, 1)
      true -> options[:spacing]
    end
  end

  @doc "The smallest spacing, to which a shape closes up if there is little room."
  @spec least_spacing() :: float()
  def least_spacing, do: @least_spacing

  @doc """
  The slots of the followers of a group of `robots`, in the leader's frame. A circle needs to know
  how far ahead of the leader its centre is, in metres.

      iex> Swarm.Formation.slots({:column, 1.5}, 3)
      [Hal.Pose.new(-1.5, 0), Hal.Pose.new(-3, 0)]
      iex> Swarm.Formation.slots({:line, 1.0}, 4) |> Enum.map(& &1.y)
      [1.0, -1.0, 2.0]
      iex> Swarm.Formation.slots({:wedge, 1.0}, 1)
      []
  """
  @spec slots(t(), pos_integer(), float()) :: [Pose.t()]
  def slots(formation, robots, distance \\ @least_ring)

  def slots(formation, robots, distance),
    do: for(k <- 1..(robots - 1)//1, do: slot_of(formation, k, robots, distance))

  @doc """
  The slot of the follower ranked `rank` (1 is the first) in a group of `robots`: one of `slots/3`, without the others.

      iex> Swarm.Formation.slot_of({:column, 1.5}, 2, 3, 1.2) == Enum.at(Swarm.Formation.slots({:column, 1.5}, 3), 1)
      true
  """
  @spec slot_of(t(), rank :: pos_integer(), pos_integer(), float()) :: Pose.t()
  def slot_of({:circle, _spacing} = formation, k, robots, distance) do
    radius = ring(formation, robots)
    # Seen from the centre the leader is at angle pi.
    angle = :math.pi() + 2 * :math.pi() * k / robots

    Pose.new(
      distance + radius * :math.cos(angle),
      radius * :math.sin(angle),
      angle + :math.pi()
    )
  end

  def slot_of({kind, d}, k, robots, _distance), do: kind |> slot(k, robots) |> scale(d)

  @doc """
  The radius of the ring of `robots`, the leader included.

      iex> Swarm.Formation.ring({:circle, 1.0}, 12) |> Float.round(3)
      1.932
  """
  @spec ring(t(), pos_integer()) :: float()
  def ring({:circle, _spacing}, 1), do: @least_ring

  def ring({:circle, spacing}, robots),
    do: max(@least_ring, spacing / (2 * :math.sin(:math.pi() / robots)))

  defp slot(:column, k, _robots), do: {-k * 1.0, 0.0}
  defp slot(:line, k, _robots), do: {0.0, side(k) * arm(k)}

  defp slot(:wedge, k, _robots) do
    j = arm(k) * :math.sqrt(0.5)
    {-j, side(k) * j}
  end

  defp slot(:triangle, k, _robots) do
    row = trunc((:math.sqrt(8 * k + 1) - 1) / 2)
    place = k - div(row * (row + 1), 2)
    {-row * :math.sqrt(3) / 2, row / 2 - place}
  end

  defp slot(:diamond, k, robots) do
    widest = widest(robots)
    {row, place} = diamond_row(k, 1, widest)
    here = min(row_width(row, widest), robots - (k - place))
    {-(row - 1) * 1.0, (here - 1) / 2 - place}
  end

  defp slot(kind, k, robots), do: Keyword.fetch!(added(), kind).slot(k, robots)

  # The row (from 1) of robot k in rows of 1, 2, …, widest, …, 2, 1, and its place in it (from 0).
  defp diamond_row(k, row, widest) do
    width = row_width(row, widest)
    if k < width, do: {row, k}, else: diamond_row(k - width, row + 1, widest)
  end

  defp row_width(row, widest), do: max(widest - abs(widest - row), 1)

  # m rows up and m - 1 down hold m * m robots.
  defp widest(robots), do: robots |> :math.sqrt() |> ceil()

  defp rows(robots), do: trunc((:math.sqrt(8 * max(robots - 1, 0) + 1) - 1) / 2) + 1

  defp arm(k), do: div(k + 1, 2) * 1.0
  defp side(k), do: if(rem(k, 2) == 1, do: 1.0, else: -1.0)
  defp scale({x, y}, d), do: Pose.new(x * d, y * d)
end
