defmodule Swarm.Membership.NameSet do
  @moduledoc """
  Packs a set of names into one binary, for heartbeats that list the robots that a robot hears. A hundred robots
  exchange fifty thousand heartbeats a second; a list of a hundred names would be copied at every send, every write to a
  board and every read of one, while a binary is shared. Pure.
  """
  alias Hal.ExternalTerm

  @typedoc "The names, sorted, each with a zero before and behind it."
  @type t :: binary()

  # A thousand names of thirty letters.
  @most 32_000

  @doc """
  The set of these names.

      iex> roll = Swarm.Membership.NameSet.new([:mag2, :mag1])
      iex> {Swarm.Membership.NameSet.names(roll), Swarm.Membership.NameSet.member?(roll, :mag1), Swarm.Membership.NameSet.member?(roll, :mag)}
      {[:mag1, :mag2], true, false}
  """
  @spec new([atom()]) :: t()
  def new([]), do: <<>>

  def new(ids),
    do: IO.iodata_to_binary([0 | for(id <- Enum.sort(ids), do: [Atom.to_string(id), 0])])

  @doc "Whether a robot is in the set."
  @spec member?(t(), atom()) :: boolean()
  def member?(roll, id), do: :binary.match(roll, entry(id)) != :nomatch

  @doc "The names in the set; names that are not atoms on this node are left out."
  @spec names(t()) :: [atom()]
  def names(roll) do
    for name <- :binary.split(roll, <<0>>, [:global, :trim_all]),
        {:ok, id} <- [ExternalTerm.atom(name)],
        do: id
  end

  @doc """
  Whether it equals this set without that robot; compares bytes, because the answer is mostly yes.

      iex> all = Swarm.Membership.NameSet.new([:mag1, :mag2, :mag3])
      iex> for ids <- [[:mag1, :mag3], [:mag1]], do: Swarm.Membership.NameSet.all_but?(Swarm.Membership.NameSet.new(ids), all, :mag2)
      [true, false]
  """
  @spec all_but?(t(), all :: t(), atom()) :: boolean()
  def all_but?(roll, all, id) do
    case :binary.match(all, entry(id)) do
      {at, length} -> all_but_at?(roll, all, at, length)
      :nomatch -> roll == all
    end
  end

  defp all_but_at?(<<>>, all, _at, length), do: byte_size(all) == length

  # Front, one zero, back: compared as they are, not put together first.
  defp all_but_at?(roll, all, at, length) do
    back = byte_size(all) - at - length

    byte_size(roll) == at + 1 + back and
      binary_part(roll, 0, at + 1) == binary_part(all, 0, at + 1) and
      binary_part(roll, at + 1, back) == binary_part(all, at + length, back)
  end

  @doc """
  Whether a term from outside can be a set of names.

      iex> for term <- [Swarm.Membership.NameSet.new([:mag1]), <<>>, [:mag1], "mag1"], do: Swarm.Membership.NameSet.valid?(term)
      [true, true, false, false]
  """
  @spec valid?(term()) :: boolean()
  def valid?(<<>>), do: true

  def valid?(<<0, _::binary>> = roll),
    do: byte_size(roll) <= @most and :binary.last(roll) == 0

  def valid?(_other), do: false

  defp entry(id), do: <<0, Atom.to_string(id)::binary, 0>>
end
