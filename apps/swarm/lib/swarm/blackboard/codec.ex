defmodule Swarm.Blackboard.Codec do
  @moduledoc """
  Encodes what blackboards exchange in datagrams: rows, and the messages that find missing ones.
  Pure.

  | term | means |
  |---|---|
  | `{:rows, [{name, id, incarnation, sequence, age_ms, payload}]}` | rows |
  | `{:digest, first, until, [{name, hash}]}` | my rows of the robots in this range of names |
  | `{:have, [{name, [{id, incarnation, sequence}]}]}` | my rows of these robots: send what I lack |
  | `{:want, [{name, id}]}` | send these |

  Names of robots travel as text, keys as a number, and keys with their values as bytes, so that a
  node can relay rows whose atoms it does not know; nothing that arrives becomes an atom. For a
  hint, the name is the byte of its bucket, `incarnation` its count and `sequence`
  `{writer, check}`; a deleted hint has an empty payload.
  """
  alias Hal.ExternalTerm
  alias Swarm.Blackboard.{AntiEntropy, Rows}
  alias Swarm.Wire

  # The size of a datagram's payload; larger terms are sent alone.
  @datagram 1_200
  # Compressed terms may be far larger than their bytes.
  @compressed 80
  @ids 4_294_967_296
  # No count of hints gets as far (`Swarm.Wire.CounterGuard`).
  @counts 6_000_000_000_000_000_000
  # Higher than any time of day: even if a wrong number is as high as one can be, there is a higher
  # one to outbid it (`Swarm.Blackboard.Rows.possible?/2`).
  @latest 9_000_000_000_000_000_000
  # No robot writes this often in one life.
  @most 1_000_000_000_000_000
  # Older rows travel with this age.
  @oldest_ms 1_000_000_000

  @type key :: atom() | {atom(), atom() | integer()}
  @type id :: non_neg_integer()

  @doc "The highest incarnation that other boards read."
  @spec latest() :: pos_integer()
  def latest, do: @latest

  @doc """
  Whether a term can be the key of a row: a name, or a pair of a name and an identifier.

      iex> for key <- [:about, {:task, 3}, nil, "about", {:a, :b, :c}], do: Swarm.Blackboard.Codec.key?(key)
      [true, true, false, false, false]
  """
  @spec key?(term()) :: boolean()
  def key?({name, of}),
    do: Wire.name?(name) and (Wire.name?(of) or Wire.number?(of))

  def key?(name), do: Wire.name?(name)

  @doc "The number of a key, the same on every machine."
  @spec id(key()) :: id()
  def id(key), do: :erlang.phash2(key, @ids)

  @doc """
  Encodes a key and its value as bytes; `decode/1` decodes them.

      iex> Swarm.Blackboard.Codec.decode(Swarm.Blackboard.Codec.encode(:about, %{battery: 12.1}))
      {:ok, :about, %{battery: 12.1}}
      iex> Swarm.Blackboard.Codec.decode("junk")
      :error
  """
  @spec encode(key(), term()) :: binary()
  def encode(key, value), do: :erlang.term_to_binary({key, value}, minor_version: 2)

  @doc "Decodes a key and its value; `:error` also if this node does not know a name in it."
  @spec decode(binary()) :: {:ok, key(), term()} | :error
  def decode(<<131, @compressed, _rest::binary>>), do: :error

  def decode(payload) do
    case :erlang.binary_to_term(payload, [:safe]) do
      {key, value} -> {:ok, key, value}
      _other -> :error
    end
  rescue
    ArgumentError -> :error
  end

  @doc "Rows as terms for datagrams."
  @spec tell([Rows.row()]) :: [term()]
  def tell(rows) do
    for {owner, id, {n, m}, age_ms, value} <- rows do
      {name(owner), id, n, m, min(age_ms, @oldest_ms), value}
    end
    |> pack()
    |> Enum.map(&{:rows, &1})
  end

  @doc "A digest as terms for datagrams, each of which gives its range of names."
  @spec digest(AntiEntropy.digest()) :: [term()]
  def digest(digest) do
    parts = pack(for {owner, hash} <- digest, do: {name(owner), hash})
    firsts = parts |> Enum.drop(1) |> Enum.map(fn [{name, _hash} | _] -> name end)

    case Enum.zip([parts, ["" | firsts], firsts ++ [nil]]) do
      [] -> [{:digest, "", nil, []}]
      parts -> for {part, first, until} <- parts, do: {:digest, first, until, part}
    end
  end

  @doc "Stamps as terms for datagrams."
  @spec have(AntiEntropy.stamps()) :: [term()]
  def have(stamps) do
    stamps =
      for {owner, own} <- stamps, do: {name(owner), for({id, {n, m}} <- own, do: {id, n, m})}

    for part <- pack(stamps), do: {:have, part}
  end

  @doc "Requests for rows as terms for datagrams."
  @spec want([{Rows.owner(), id()}]) :: [term()]
  def want(wanted),
    do: for(part <- pack(for {owner, id} <- wanted, do: {name(owner), id}), do: {:want, part})

  @doc "The name of an owner in datagrams: a robot's name as text, a bucket's single byte."
  @spec name(Rows.owner()) :: binary()
  def name(robot) when is_atom(robot), do: Atom.to_string(robot)
  def name(bucket), do: <<bucket>>

  @doc """
  Splits terms into lists, each small enough for a datagram; a term that is too large for that is
  alone.

      iex> Swarm.Blackboard.Codec.pack([])
      []
      iex> for part <- Swarm.Blackboard.Codec.pack(Enum.map(1..3, &{&1, :binary.copy("x", 500)})), do: length(part)
      [2, 1]
  """
  @spec pack([term()]) :: [[term(), ...]]
  def pack(terms) do
    # The terms around the list: the tag of the list, and two bounds.
    room = @datagram - 100

    terms
    |> Enum.chunk_while(
      {[], 0},
      fn term, {part, size} ->
        bytes = :erlang.external_size(term)

        if part != [] and size + bytes > room,
          do: {:cont, Enum.reverse(part), {[term], bytes}},
          else: {:cont, {[term | part], size + bytes}}
      end,
      fn {part, _size} ->
        if part == [], do: {:cont, []}, else: {:cont, Enum.reverse(part), []}
      end
    )
  end

  @type heard ::
          {:rows, [Rows.row()]}
          | {:digest, String.t(), String.t() | nil, AntiEntropy.digest()}
          | {:have, AntiEntropy.stamps()}
          | {:want, [{Rows.owner(), id()}]}

  @doc """
  Decodes a term from outside, and counts what was dropped: senseless entries, and those of robots
  whose names are not known here.

      iex> Swarm.Blackboard.Codec.read({:want, [{"mag1", 5}, :junk]})
      {{:want, [mag1: 5]}, 1}
      iex> Swarm.Blackboard.Codec.read(%{junk: 1})
      :error
  """
  @spec read(term()) :: {heard(), dropped :: non_neg_integer()} | :error
  def read({:digest, first, until, list})
      when is_binary(first) and (until == nil or is_binary(until)) do
    with {:ok, digest, dropped} <- each(list, &number/1),
         do: {{:digest, first, until, digest}, dropped}
  end

  def read({what, list}) when what in [:rows, :have, :want] do
    read = %{rows: &row/1, have: &stamps/1, want: &number/1}
    with {:ok, heard, dropped} <- each(list, read[what]), do: {{what, heard}, dropped}
  end

  def read(_other), do: :error

  defp each(list, read) do
    if Wire.list?(list, fn _any -> true end) do
      good = for term <- list, {:ok, good} <- [read.(term)], do: good
      {:ok, good, length(list) - length(good)}
    else
      :error
    end
  end

  defguardp id?(id) when is_integer(id) and id >= 0 and id < @ids

  defp row({name, id, n, m, age_ms, payload})
       when id?(id) and age_ms in 0..@oldest_ms and is_binary(payload) do
    with {:ok, owner} <- owner(name),
         true <- stamp?(owner, id, n, m),
         true <- is_atom(owner) or Rows.hint_stamp(n, elem(m, 0), payload) == {n, m},
         do: {:ok, {owner, id, {n, m}, age_ms, payload}},
         else: (_other -> :error)
  end

  defp row(_other), do: :error

  # A hash, or a request.
  defp number({name, number}) when id?(number) do
    with {:ok, owner} <- owner(name), do: {:ok, {owner, number}}
  end

  defp number(_other), do: :error

  defp stamps({name, list}) do
    with {:ok, owner} <- owner(name),
         {:ok, stamps, 0} <- each(list, &stamp(owner, &1)),
         do: {:ok, {owner, stamps}},
         else: (_other -> :error)
  end

  defp stamps(_other), do: :error

  defp stamp(owner, {id, n, m}) when id?(id),
    do: if(stamp?(owner, id, n, m), do: {:ok, {id, {n, m}}}, else: :error)

  defp stamp(_owner, _other), do: :error

  defp stamp?(robot, _id, incarnation, sequence) when is_atom(robot),
    do: incarnation in 0..@latest and sequence in 0..@most

  defp stamp?(bucket, id, count, {writer, check}) when id?(check),
    do: Rows.bucket(id) == bucket and count in 1..@counts and text?(writer)

  defp stamp?(_bucket, _id, _count, _other), do: false

  defp text?(name), do: is_binary(name) and byte_size(name) in 1..255

  defp owner(<<bucket>>) when bucket in 0..15, do: {:ok, bucket}
  defp owner(name), do: robot(name)

  @doc """
  The atom of a name, if there is one.

      iex> Swarm.Blackboard.Codec.robot("mag1")
      {:ok, :mag1}
      iex> Swarm.Blackboard.Codec.robot("no robot was ever called so")
      :error
  """
  @spec robot(term()) :: {:ok, atom()} | :error
  def robot(name) when is_binary(name) and byte_size(name) in 1..255 do
    with {:ok, robot} <- ExternalTerm.atom(name),
         do: if(Wire.name?(robot), do: {:ok, robot}, else: :error)
  end

  def robot(_other), do: :error

  @typedoc "A name that travelled as text, if this node has no such atom."
  @type word :: atom() | String.t()

  @doc "A name that travelled as text: its atom, or the text if this node has no such atom."
  @spec word(String.t()) :: word()
  def word(text) do
    case robot(text) do
      {:ok, atom} -> atom
      :error -> text
    end
  end
end
