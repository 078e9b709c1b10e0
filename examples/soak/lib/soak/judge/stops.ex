defmodule Soak.Judge.Stops do
  @moduledoc """
  Judges the emergency stop: ordered on one robot, it holds all that are reachable from those that have it. Pure;
  times in microseconds.

  Robots that were undisturbed since the order have 1 s; those that have come to be reachable since have 6 s: a
  node that has just started is believed only after it was heard anew (docs/times.md).
  """
  alias Soak.Links

  @at_once_us 1_000_000
  @later_us 6_000_000
  # The logs are read five times a second, and the machine is busy with other things.
  @slack_us 500_000

  defstruct order: nil, held: %{}, worst_us: 0, count: 0

  @typedoc "`order` is the stop that is in force, `{robot, at_us}`; `held` who says that it is held."
  @type t :: %__MODULE__{}

  @doc "A stop was ordered on this robot."
  @spec order(t(), atom(), integer()) :: t()
  def order(stops, robot, us), do: %{stops | order: {robot, us}, count: stops.count + 1}

  @doc "The node answered that it knows of no robot: nobody was said to be held."
  @spec refuse(t()) :: t()
  def refuse(stops), do: %{stops | order: nil, count: stops.count - 1}

  @doc "The stop was released, or is about to be."
  @spec release(t()) :: t()
  def release(stops), do: %{stops | order: nil}

  @doc "A robot says whether it is held; `nil` when it is gone."
  @spec note(t(), atom(), boolean() | nil, integer(), Links.t()) :: t()
  def note(%{order: {_from, at_us}} = stops, robot, true, us, links) do
    stops = put_in(stops.held[robot], true)
    # How long it took those that nothing kept from hearing it.
    if calm?(links, robot, at_us),
      do: %{stops | worst_us: max(stops.worst_us, us - at_us)},
      else: stops
  end

  def note(stops, robot, held, _us, _links), do: put_in(stops.held[robot], held)

  defp calm?(links, robot, at_us) do
    since = links.here[robot]
    since != nil and since <= at_us and links.changed <= at_us
  end

  @doc "What is wrong now."
  @spec judge(t(), Links.t(), integer()) :: [{String.t(), term()}]
  def judge(%{order: nil}, _links, _now), do: []

  def judge(%{order: {from, at_us}} = stops, links, now) do
    held = for {robot, true} <- stops.held, do: robot
    # A robot that has started again since has forgotten it, if no other one has told it.
    begun = if (links.here[from] || now) <= at_us, do: [from | held], else: held

    for robot <- Links.reach(links, begun),
        stops.held[robot] != true,
        late?(links, robot, at_us, now) do
      {"#{robot} is not held #{div(now - at_us, 1000)} ms after the e-stop on #{from}",
       {:stop, robot, at_us}}
    end
  end

  defp late?(links, robot, at_us, now) do
    if calm?(links, robot, at_us),
      do: now - at_us > @at_once_us + @slack_us,
      else: now - Enum.max([at_us, links.here[robot], links.changed]) > @later_us + @slack_us
  end
end
