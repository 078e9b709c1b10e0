defmodule Soak.Judge.Growth do
  @moduledoc """
  Judges whether memory and atoms of a node stay flat while it lives. Pure; times in microseconds.

  A node is left alone for its first minute, in which it loads code. Then the least memory of each minute counts,
  because garbage waits for its collection at any moment; later minutes may exceed the first by 12 MB, and atoms by
  1,000: what a robot's own life makes, such as modules that are loaded by what happens for the first time.
  """

  @warm_us 60_000_000
  @minute_us 60_000_000
  @bytes 12_000_000
  @atoms 1_000

  defstruct lives: %{}, told: %{}

  @typedoc "`told` are the first and the newest figures of each robot over all its lives."
  @type t :: %__MODULE__{}

  @doc "A node has started."
  @spec start(t(), atom(), integer()) :: t()
  def start(growth, robot, us),
    do: put_in(growth.lives[robot], %{since: us, minute: nil, first: nil})

  @doc "A robot's node has told its figures. What is wrong with them."
  @spec note(t(), atom(), map(), integer()) :: {[{String.t(), term()}], t()}
  def note(growth, robot, %{bytes: bytes, atoms: atoms}, us) do
    now = %{bytes: bytes, atoms: atoms}
    told = Map.update(growth.told, robot, %{first: now, last: now}, &%{&1 | last: now})
    growth = %{growth | told: told}

    case growth.lives[robot] do
      %{since: since} = life when us - since > @warm_us ->
        {wrong, life} = minute(life, robot, div(us - since - @warm_us, @minute_us), now)
        {wrong, put_in(growth.lives[robot], life)}

      _young ->
        {[], growth}
    end
  end

  defp minute(%{minute: {n, least}} = life, _robot, n, now),
    do: {[], %{life | minute: {n, Map.merge(least, now, fn _key, a, b -> min(a, b) end)}}}

  defp minute(%{minute: nil} = life, _robot, n, now), do: {[], %{life | minute: {n, now}}}

  # A minute has passed.
  defp minute(%{minute: {_n, least}, first: nil} = life, _robot, n, now),
    do: {[], %{life | minute: {n, now}, first: least}}

  defp minute(%{minute: {_n, least}, first: first} = life, robot, n, now),
    do: {grown(robot, first, least, life.since), %{life | minute: {n, now}}}

  defp grown(robot, first, least, since) do
    for {key, bound} <- [bytes: @bytes, atoms: @atoms], least[key] - first[key] > bound do
      {"#{robot} has grown from #{first[key]} to #{least[key]} #{key}",
       {:growth, robot, key, since}}
    end
  end
end
