defmodule Record.Recording.Names do
  @moduledoc false
  # Lists the names in a recording: of robots, nodes and what else is an atom in its terms. A reader on another machine need
  # not know them, and terms create no atoms when they are read. So a recording says its names as text, and these alone
  # become atoms: at most 1,000 of a file, of a name's form. Pure but for `know/2`.

  alias Hal.ExternalTerm

  @most 1_000
  @form ~r/\A[A-Za-z_][A-Za-z0-9_@.?!-]{0,94}\z/
  @module "Elixir."

  @type t :: MapSet.t(atom())

  @doc "How many names of a file may be new to a reader."
  @spec most() :: pos_integer()
  def most, do: @most

  @doc """
  The names, and those of a term.

      iex> Record.Recording.Names.add(MapSet.new(), {:rover7, [%{peer: :base2}, 3.0]}) |> Record.Recording.Names.texts()
      ["base2", "peer", "rover7"]
  """
  @spec add(t(), term()) :: t()
  def add(names, atom) when is_atom(atom), do: MapSet.put(names, atom)
  def add(names, tuple) when is_tuple(tuple), do: add(names, Tuple.to_list(tuple))
  def add(names, [first | rest]), do: names |> add(first) |> add(rest)

  def add(names, map) when is_map(map),
    do: :maps.fold(fn key, value, names -> names |> add(key) |> add(value) end, names, map)

  def add(names, _other), do: names

  @doc "The names as texts, sorted, but for modules, which a reader has or cannot replay."
  @spec texts(t()) :: [String.t()]
  def texts(names) do
    for name <- names, text = Atom.to_string(name), not String.starts_with?(text, @module) do
      text
    end
    |> Enum.sort()
  end

  @doc """
  Makes the names known to this program, of which so many may be new. Returns how many may be new after that; the error is
  one line.

      iex> Record.Recording.Names.know(["mag1", "nil"], 5)
      {:ok, 5}
      iex> Record.Recording.Names.know(["two words"], 5)
      {:error, "names what is no name of a robot or a node: \\"two words\\""}
  """
  @spec know(term(), left :: non_neg_integer()) ::
          {:ok, left :: non_neg_integer()} | {:error, line :: String.t()}
  def know([text | rest], left) when is_binary(text) do
    cond do
      ExternalTerm.atom(text) != :error ->
        know(rest, left)

      not Regex.match?(@form, text) ->
        {:error,
         "names what is no name of a robot or a node: #{inspect(text, printable_limit: 40)}"}

      left == 0 ->
        {:error, "has more than #{@most} names that this program does not know"}

      true ->
        _name = String.to_atom(text)
        know(rest, left - 1)
    end
  end

  def know([], left), do: {:ok, left}
  def know(_other, _left), do: {:error, "begins with something that this program did not record"}
end
