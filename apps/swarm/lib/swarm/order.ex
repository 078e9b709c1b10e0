defmodule Swarm.Order do
  @moduledoc """
  Checks the orders that a person may give to a robot: at the sender, and again at the robot.
  Pure.
  """
  alias Hal.Pose
  alias Robot.Command
  alias Swarm.Formation
  alias Swarm.Wire

  # Farther than any floor, and faster than any robot: larger numbers are typing errors.
  @farthest 10_000
  @fastest 10
  # Radians.
  @behind 3.2
  # Seconds.
  @longest_s 600
  # Bytes of a message to a mission, as `Robot.Command` takes them.
  @longest_text 500
  # Metres, as `Robot.Behaviour.Square` takes them.
  @least_side 0.2
  @most_side 10.0

  @typedoc "What a person may ask of a robot: a command for it alone, or one for its group."
  @type t ::
          Command.t()
          | {:start, keyword()}
          | {:start, module(), keyword()}
          | {:formation, Formation.kind(), spacing :: float()}

  @doc """
  Checks that the numbers of a person's command make sense; the error is one line that names the
  one that does not.

      iex> Swarm.Order.check({:goto, 1, 2.0, nil})
      {:ok, {:goto, 1.0, 2.0, nil}}
      iex> Swarm.Order.check({:goto, :far, 2.0, nil})
      {:error, "goto: expected a number from -10000 to 10000, got :far"}
      iex> Swarm.Order.check({:move, 99, 0})
      {:error, "move: expected a number from -10 to 10, got 99"}
      iex> Swarm.Order.check({:move, 0.5, 0, -1})
      {:error, "move: expected a number of seconds from 0 to 600, got -1"}
  """
  @spec check(term()) :: {:ok, t()} | {:error, line :: String.t()}
  def check({:goto, x, y, nil}), do: numbers(:goto, [x, y], @farthest, &{:goto, &1, &2, nil})

  def check({:goto, x, y, h}),
    do: numbers(:goto, [x, y, h], @farthest, &{:goto, &1, &2, turn(&3)})

  def check({:look, pan}), do: numbers(:look, [pan], @behind, &{:look, &1})
  def check({:move, v, w}), do: numbers(:move, [v, w], @fastest, &{:move, &1, &2})

  def check({:move, v, w, for_s}) do
    with {:ok, {:move, v, w}} <- check({:move, v, w}),
         {:ok, for_s} <- within(:move, for_s, 0, @longest_s),
         do: {:ok, {:move, v, w, for_s}}
  end

  def check({:square, nil}), do: {:ok, {:square, nil}}

  def check({:square, side}) do
    if is_number(side) and side >= @least_side and side <= @most_side,
      do: {:ok, {:square, side * 1.0}},
      else:
        {:error,
         "square: expected a side from #{@least_side} to #{@most_side} m, got #{brief(side)}"}
  end

  def check({:follow, %Pose{x: x, y: y, heading: h}}),
    do: numbers(:follow, [x, y, h], @farthest, &{:follow, Pose.new(&1, &2, &3)})

  # Robots tell each other this in their heartbeats and rounds. Robots would not believe a person who
  # says it, and the robot must not leave its mission for nothing.
  def check({word, _robot}) when word in [:subscribe, :unsubscribe],
    do:
      {:error,
       "#{word} is for robots only, and each sends its pose to all, five times a second; " <>
         "followtheleader:NAME follows one"}

  def check({:position, _pose}),
    do:
      {:error,
       "position is for robots only, which report their own; goto:X:Y:THETA sends one there"}

  def check({:blob, _pose, _size, _found?}),
    do: {:error, "blob is for robots only, which report what they see; findblob lets one search"}

  def check(command) do
    if known?(command),
      do: {:ok, command},
      else: {:error, "expected a command of Robot.Command, got #{brief(command)}"}
  end

  defp known?(word) when word in [:stop, :lead, :start, :ping, :keep, :wander, :rest], do: true
  defp known?({:follow_the_leader, robot}), do: Wire.name?(robot)

  defp known?({:send, text}),
    do: is_binary(text) and byte_size(text) <= @longest_text and String.printable?(text)

  defp known?({:find_blob, colour}), do: colour == nil or is_binary(colour)
  defp known?({:formation, kind, spacing}), do: Formation.valid?({kind, spacing})
  defp known?({:start, options}), do: Keyword.keyword?(options)
  defp known?({:start, module, options}), do: is_atom(module) and Keyword.keyword?(options)
  defp known?({:run, module, options}), do: is_atom(module) and Keyword.keyword?(options)
  defp known?(_other), do: false

  defp brief(term), do: inspect(term, limit: 5, printable_limit: 40)

  defp turn(heading), do: Pose.wrap(heading)

  defp within(_word, number, least, most)
       when is_number(number) and number >= least and number <= most,
       do: {:ok, number * 1.0}

  defp within(word, wrong, least, most),
    do:
      {:error,
       "#{word}: expected a number of seconds from #{least} to #{most}, got #{brief(wrong)}"}

  # Elixir has neither NaN nor infinities, so they cannot occur.
  defp numbers(word, list, most, build) do
    case Enum.reject(list, &(is_number(&1) and abs(&1) <= most)) do
      [] ->
        {:ok, apply(build, Enum.map(list, &(&1 * 1.0)))}

      [wrong | _] ->
        {:error, "#{word}: expected a number from -#{most} to #{most}, got #{inspect(wrong)}"}
    end
  end

  @doc """
  An order in one short line, for logs.

      iex> for order <- [:stop, {:estop, {:base@hall, 1, 1}}, {:goto, 1.0, -2.5, nil}, {:start, Some.Mission, []}, {:message, :leg, leg: 3}],
      ...>     do: Swarm.Order.words(order)
      ["stop", "estop", "goto 1.0 -2.5", "start Some.Mission", "send leg:leg=3"]
  """
  @spec words(term()) :: String.t()
  def words({:estop, _call}), do: "estop"

  def words({:message, kind, fields}),
    do:
      "send #{kind}:" <>
        Enum.map_join(fields, ",", fn {key, value} -> "#{key}=#{brief(value)}" end)

  def words(order) when is_tuple(order) and tuple_size(order) > 0,
    do: order |> Tuple.to_list() |> Enum.reject(&(&1 in [nil, []])) |> Enum.map_join(" ", &word/1)

  def words(order), do: word(order)

  defp word(atom) when is_atom(atom),
    do: atom |> inspect() |> String.trim_leading(":")

  defp word(term), do: brief(term)

  @doc """
  Whether a robot may follow another: not itself, and none that follows it, directly or through
  others. `leaders` says which robot each follows.

      iex> Swarm.Order.follow(:min1, :mag1, %{mag1: nil})
      :ok
      iex> Swarm.Order.follow(:mag1, :mag1, %{})
      {:error, "mag1 cannot follow itself"}
      iex> Swarm.Order.follow(:min1, :mag1, %{mag1: :mag2, mag2: :min1})
      {:error, "min1 cannot follow mag1, who follows min1 (mag1 -> mag2 -> min1)"}
  """
  @spec follow(atom(), atom(), %{atom() => atom() | nil}) :: :ok | {:error, String.t()}
  def follow(me, me, _leaders), do: {:error, "#{me} cannot follow itself"}

  def follow(me, leader, leaders) do
    chain = chain([leader], leaders)

    if me in chain,
      do:
        {:error, "#{me} cannot follow #{leader}, who follows #{me} (#{Enum.join(chain, " -> ")})"},
      else: :ok
  end

  defp chain([last | _] = seen, leaders) do
    case leaders[last] do
      nil -> Enum.reverse(seen)
      next -> if next in seen, do: Enum.reverse(seen), else: chain([next | seen], leaders)
    end
  end
end
