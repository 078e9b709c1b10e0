defmodule Hal.Cli.Parse do
  @moduledoc """
  Parses text into checked values: numbers, points, choices. Pure.

  Each function returns `{:ok, value}` or `{:error, what_is_allowed}`, with a hint if there is
  one. Numbers are plain decimals with few digits, so "nan", "inf" and "1e999" are not even
  numbers.
  """

  @longest 12

  @doc """
  A whole number in a range.

      iex> Hal.Cli.Parse.whole("6", 1..100)
      {:ok, 6}
      iex> Hal.Cli.Parse.whole("1e9", 1..100)
      {:error, "a whole number from 1 to 100"}
  """
  @spec whole(String.t(), Range.t()) :: {:ok, integer()} | {:error, String.t()}
  def whole(text, first..last//_) do
    with true <- byte_size(text) <= @longest,
         {number, ""} when number >= first and number <= last <- Integer.parse(text) do
      {:ok, number}
    else
      _ -> {:error, "a whole number from #{first} to #{last}"}
    end
  end

  @doc """
  Any text but none: a name, a file.

      iex> {Hal.Cli.Parse.text("a.txt"), Hal.Cli.Parse.text("")}
      {{:ok, "a.txt"}, {:error, "a text"}}
  """
  @spec text(String.t()) :: {:ok, String.t()} | {:error, String.t()}
  def text(""), do: {:error, "a text"}
  def text(text), do: {:ok, text}

  @doc """
  Whole numbers within bounds, with commas between.

      iex> Hal.Cli.Parse.wholes("6,20", 1..100)
      {:ok, [6, 20]}
      iex> Hal.Cli.Parse.wholes("6,200", 1..100)
      {:error, "whole numbers from 1 to 100, with commas between"}
  """
  @spec wholes(String.t(), Range.t()) :: {:ok, [integer(), ...]} | {:error, String.t()}
  def wholes(text, bounds) do
    results = for number <- String.split(text, ","), do: whole(number, bounds)

    if Enum.all?(results, &match?({:ok, _number}, &1)),
      do: {:ok, for({:ok, number} <- results, do: number)},
      else: {:error, "whole numbers from #{bounds.first} to #{bounds.last}, with commas between"}
  end

  @doc """
  A number between two bounds.

      iex> Hal.Cli.Parse.number("-0.5", -1, 1)
      {:ok, -0.5}
      iex> Hal.Cli.Parse.number("nan", 0, 1)
      {:error, "a number from 0 to 1"}
  """
  @spec number(String.t(), number(), number()) :: {:ok, float()} | {:error, String.t()}
  def number(text, least, most) do
    with {:ok, number} when number >= least and number <= most <- decimal(text) do
      {:ok, number}
    else
      _ -> {:error, "a number from #{least} to #{most}"}
    end
  end

  @doc """
  One of some words, as the atom it stands for.

      iex> Hal.Cli.Parse.choice("on", on: true, off: false)
      {:ok, true}
      iex> Hal.Cli.Parse.choice("of", on: true, off: false)
      {:error, {"on or off", "; did you mean off?"}}
  """
  @spec choice(String.t(), keyword()) ::
          {:ok, term()} | {:error, Hal.Cli.Arguments.allowed()}
  def choice(text, words) do
    names = Enum.map(words, fn {word, _value} -> Atom.to_string(word) end)

    case Enum.find(words, fn {word, _value} -> Atom.to_string(word) == text end) do
      {_word, value} ->
        {:ok, value}

      nil ->
        {:error, {either(names), Hal.Options.Suggest.hint(text, names)}}
    end
  end

  @doc """
  A place, `X,Y` in metres.

      iex> Hal.Cli.Parse.point("-2,1.5")
      {:ok, {-2.0, 1.5}}
      iex> Hal.Cli.Parse.point("2;1")
      {:error, "X,Y in metres, each from -1000 to 1000"}
  """
  @spec point(String.t()) :: {:ok, {float(), float()}} | {:error, String.t()}
  def point(text) do
    with [x, y] <- String.split(text, ","),
         {:ok, x} <- number(String.trim(x), -1000, 1000),
         {:ok, y} <- number(String.trim(y), -1000, 1000) do
      {:ok, {x, y}}
    else
      _ -> {:error, "X,Y in metres, each from -1000 to 1000"}
    end
  end

  @doc """
  Something at a simulated second, `WHAT@T`; `check` checks `WHAT`.

      iex> Hal.Cli.Parse.at("3,2@40", &Hal.Cli.Parse.point/1, "X,Y@T")
      {:ok, {{3.0, 2.0}, 40.0}}
  """
  @spec at(String.t(), Hal.Cli.Arguments.check(), String.t()) ::
          {:ok, {term(), float()}} | {:error, String.t()}
  def at(text, check, form) do
    with [what, time] <- String.split(text, "@"),
         {:ok, what} <- check.(what),
         {:ok, at_s} <- number(time, 0, 3600) do
      {:ok, {what, at_s}}
    else
      _ -> {:error, form <> ", T a simulated second from 0 to 3600"}
    end
  end

  @doc """
  A span of whole numbers, `A-B`.

      iex> Hal.Cli.Parse.span("1-40", 0..100)
      {:ok, 1..40}
  """
  @spec span(String.t(), Range.t()) :: {:ok, Range.t()} | {:error, String.t()}
  def span(text, bounds) do
    case text |> String.split("-") |> Enum.map(&whole(&1, bounds)) do
      [{:ok, only}] -> {:ok, only..only}
      [{:ok, first}, {:ok, last}] when first <= last -> {:ok, first..last}
      _ -> {:error, "A-B, whole numbers from #{bounds.first} to #{bounds.last}"}
    end
  end

  @doc """
  The entries of a table that people name, in its order; each entry has a `:name`.

      iex> Hal.Cli.Parse.named("b,a", [%{name: :a}, %{name: :b}, %{name: :c}])
      {:ok, [%{name: :a}, %{name: :b}]}
      iex> Hal.Cli.Parse.named("d", [%{name: :a}, %{name: :b}])
      {:error, "names of a, b, with commas between"}
  """
  @spec named(String.t(), [entry]) :: {:ok, [entry]} | {:error, String.t()}
        when entry: %{:name => atom() | String.t(), optional(atom()) => term()}
  def named(text, entries) do
    wanted = String.split(text, ",")
    names = Enum.map(entries, &to_string(&1.name))

    if wanted -- names == [],
      do: {:ok, Enum.filter(entries, &(to_string(&1.name) in wanted))},
      else: {:error, "names of #{Enum.join(names, ", ")}, with commas between"}
  end

  @doc """
  Lists words as people write a choice.

      iex> Hal.Cli.Parse.either(~w(hall hospital arena))
      "hall, hospital or arena"
  """
  @spec either([String.t()]) :: String.t()
  def either([only]), do: only

  def either(words) do
    {most, [last]} = Enum.split(words, -1)
    Enum.join(most, ", ") <> " or " <> last
  end

  defp decimal(text) do
    with true <- byte_size(text) <= @longest,
         true <- text =~ ~r/^[+-]?\d+(\.\d+)?$/,
         {number, ""} <- Float.parse(text) do
      {:ok, number}
    else
      _ -> :error
    end
  end

  @doc """
  A folder, which is made if it does not exist; relative to `from`.

      iex> Hal.Cli.Parse.folder("tables", "/tmp")
      {:ok, "/tmp/tables"}
      iex> Hal.Cli.Parse.folder("", "/tmp")
      {:error, "the name of a folder"}
  """
  @spec folder(String.t(), Path.t()) :: {:ok, Path.t()} | {:error, String.t()}
  def folder("", _from), do: {:error, "the name of a folder"}

  def folder(text, from) do
    path = if from == ".", do: text, else: Path.expand(text, from)

    if File.exists?(path) and not File.dir?(path),
      do: {:error, "a folder, not a file"},
      else: {:ok, path}
  end
end
