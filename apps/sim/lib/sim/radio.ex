defmodule Sim.Radio do
  @moduledoc """
  Simulates a radio that delays, loses and duplicates messages, and can be partitioned, all from a seed. Pure.

  The fate of a message depends on its number alone, so the same sends give the same deliveries,
  in the order of their time and then of their number. Every copy has its own draw: one message to
  five robots can reach three of them. A message may overtake an earlier one.
  """
  alias Hal.Options
  alias Sim.Noise

  @table [
    seed: [:integer, required: true],
    loss: [{:number, 0, 1}, default: 0.0],
    duplicates: [{:number, 0, 1}, default: 0.0],
    delay_ms: [{:span, 0, 3_600_000, "whole ms"}, default: {5, 50}],
    cut: [{:check, &is_list/1, "[{:mag1, :mag2}, …]"}, default: []]
  ]

  @enforce_keys [:seed, :loss, :delay_ms, :duplicates]
  defstruct @enforce_keys ++ [cut: MapSet.new(), queue: %{}, next: 0, sent: 0, lost: 0]

  @type id :: atom()
  @typedoc "`queue` has by the time at which they are due what is under way, the newest first."
  @type t :: %__MODULE__{
          seed: integer(),
          loss: float(),
          delay_ms: {non_neg_integer(), non_neg_integer()},
          duplicates: float(),
          cut: MapSet.t({id(), id()}),
          queue: %{integer() => [{to :: id(), from :: id(), term()}, ...]},
          next: non_neg_integer(),
          sent: non_neg_integer(),
          lost: non_neg_integer()
        }

  @doc """
  A radio. `:loss` and `:duplicates` are probabilities for each recipient, `:delay_ms` the least
  and greatest delay, `:cut` the pairs that cannot hear each other. Wrong options raise `ArgumentError`.

      iex> Sim.Radio.new(seed: 1, loss: 2.0)
      ** (ArgumentError) radio option loss: expected a number from 0 to 1, got 2.0
  """
  @spec new(keyword()) :: t()
  def new(options) do
    options = Options.check!(options, @table, "radio")
    {cut, options} = Keyword.pop!(options, :cut)
    cut(struct!(__MODULE__, options), cut)
  end

  @doc "Cuts exactly these pairs from now on: they cannot hear each other, and all others can."
  @spec cut(t(), [{id(), id()}]) :: t()
  def cut(%__MODULE__{} = radio, pairs),
    do: cut_ways(radio, for({a, b} <- pairs, pair <- [{a, b}, {b, a}], do: pair))

  @doc "The same in one direction: of each `{from, to}`, the second cannot hear the first."
  @spec cut_ways(t(), [{from :: id(), to :: id()}]) :: t()
  def cut_ways(%__MODULE__{} = radio, ways), do: %{radio | cut: MapSet.new(ways)}

  @doc "Loses this share of the copies sent from now on, 0 to 1."
  @spec lose(t(), number()) :: t()
  def lose(%__MODULE__{} = radio, share) when share >= 0 and share <= 1,
    do: %{radio | loss: share * 1.0}

  @doc """
  The parts into which the cuts divide these robots, ignoring loss: within a part all can reach
  each other, if necessary by way of others.

      iex> radio = Sim.Radio.new(seed: 1, cut: [{:mag1, :mag2}, {:mag1, :mag3}])
      iex> Sim.Radio.parts(radio, [:mag1, :mag2, :mag3])
      [[:mag1], [:mag2, :mag3]]
  """
  @spec parts(t(), [id()]) :: [[id()]]
  def parts(%__MODULE__{}, []), do: []

  # Nobody is cut off.
  def parts(%__MODULE__{cut: cut}, ids) when cut == %MapSet{}, do: [ids]

  def parts(%__MODULE__{} = radio, [first | _] = ids) do
    there = reach(radio, ids, [first], &{&1, &2})
    back = reach(radio, ids, [first], &{&2, &1})
    part = Enum.filter(ids, &(&1 in there and &1 in back))
    [part | parts(radio, ids -- part)]
  end

  defp reach(radio, ids, found, way) do
    more = for b <- ids -- found, Enum.any?(found, &(way.(&1, b) not in radio.cut)), do: b
    if more == [], do: found, else: reach(radio, ids, found ++ more, way)
  end

  @doc """
  Sends a message to some robots; `sent` and `lost` count each of them.

      iex> radio = Sim.Radio.new(seed: 1, delay_ms: {5, 5}, cut: [{:mag1, :mag3}])
      iex> radio = Sim.Radio.send(radio, 0, :mag1, [:mag2, :mag3], :hello)
      iex> {[{:mag2, :mag1, :hello}], radio} = Sim.Radio.receive(radio, 5)
      iex> {radio.sent, radio.lost}
      {2, 1}
  """
  @spec send(t(), integer(), id(), [id()], term()) :: t()
  def send(%__MODULE__{} = radio, at_ms, from, to_ids, message) do
    cuts? = MapSet.size(radio.cut) > 0
    Enum.reduce(to_ids, radio, &send_one(&2, at_ms, from, &1, message, cuts?))
  end

  @doc "Whether nothing is under way."
  @spec empty?(t()) :: boolean()
  def empty?(%__MODULE__{queue: queue}), do: queue == %{}

  @doc """
  The messages that have arrived by now as `{to, from, message}`, and the radio without them.
  """
  @spec receive(t(), integer()) :: {[{id(), id(), term()}], t()}
  def receive(%__MODULE__{queue: queue} = radio, at_ms) do
    due = Enum.sort(for {due_ms, _letters} <- queue, due_ms <= at_ms, do: due_ms)
    letters = Enum.flat_map(due, &Enum.reverse(Map.fetch!(queue, &1)))
    {letters, %{radio | queue: Map.drop(queue, due)}}
  end

  defp send_one(radio, at_ms, from, to, message, cuts?) do
    number = radio.next

    if (cuts? and MapSet.member?(radio.cut, {from, to})) or hits?(radio, number, 0, radio.loss) do
      %{radio | next: number + 1, sent: radio.sent + 1, lost: radio.lost + 1}
    else
      letter = {to, from, message}
      queue = queue(radio, number, 2, at_ms, letter)

      # In the order of the numbers, so that each list stays in the order in which it was sent.
      queue =
        if hits?(radio, number, 1, radio.duplicates),
          do: queue(%{radio | queue: queue}, number, 3, at_ms, letter),
          else: queue

      %{radio | next: number + 1, sent: radio.sent + 1, queue: queue}
    end
  end

  defp queue(%{delay_ms: {least, most}, queue: queue} = radio, number, copy, at_ms, letter) do
    due_ms = at_ms + least + trunc(draw(radio, number, copy) * (most - least + 1))

    case queue do
      %{^due_ms => letters} -> %{queue | due_ms => [letter | letters]}
      _none_yet -> Map.put(queue, due_ms, [letter])
    end
  end

  # A draw is not less than 0, and need not be made for that.
  defp hits?(radio, number, use, share), do: share > 0 and draw(radio, number, use) < share

  defp draw(radio, number, use), do: Noise.unit(Noise.hash(radio.seed, 0x7AD10, number, use))
end
