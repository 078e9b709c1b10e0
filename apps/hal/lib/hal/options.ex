defmodule Hal.Options do
  @moduledoc """
  Checks all options: a table says what is allowed, and every error names the key, what was expected and what came
  instead, in the same words. Pure; creates no atoms.

  A table is a keyword list of types (`Hal.Options.Type`): `key: type`,
  `key: [type, required: true]` or `key: [type, default: value]`. An option whose default is `nil`
  may be given as `nil`.
  """
  alias Hal.Options.{Type, Wording}

  # At most this many problems are reported at once.
  @told 10

  @type table :: [{atom(), Type.t() | [Type.t() | {:required | :default, term()}]}]

  @doc """
  Checks options and adds the defaults; the error is one line with the problems. `subject` says
  whose options they are.

      iex> table = [port: [:path, required: true], baud: [{:integer, 1, 9600}, default: 300]]
      iex> Hal.Options.check([port: "/dev/ttyS0"], table, "serial")
      {:ok, [baud: 300, port: "/dev/ttyS0"]}
      iex> Hal.Options.check([port: 5, baud: 0], table, "serial")
      {:error, "serial option port: expected a path, got 5; " <>
        "baud: expected a whole number from 1 to 9600, got 0"}
      iex> Hal.Options.check([buad: 3], table, "serial")
      {:error, "serial option buad is not known: allowed are port, baud; did you mean baud?; port is missing: expected a path"}
  """
  @spec check(term(), table(), subject :: String.t()) :: {:ok, keyword()} | {:error, String.t()}
  def check(options, table, subject) do
    case Type.read({:keys, table}, options) do
      {:ok, values} -> {:ok, Keyword.merge(defaults(table), values)}
      {:error, problems} -> {:error, line(problems, subject)}
    end
  end

  @doc "The same, but raises that line as an `ArgumentError`."
  @spec check!(term(), table(), subject :: String.t()) :: keyword()
  def check!(options, table, subject) do
    case check(options, table, subject) do
      {:ok, options} -> options
      {:error, line} -> raise ArgumentError, line
    end
  end

  @doc "The defaults of a table."
  @spec defaults(table()) :: keyword()
  def defaults(table) do
    for {key, [_type | settings]} <- table,
        {:ok, value} <- [Keyword.fetch(settings, :default)],
        do: {key, value}
  end

  @doc """
  An error that a table cannot express, such as two options that do not fit together.

      iex> Hal.Options.refuse("rflex", [:limits, :max_turn], 2.0, "what the body can do, 0.9,")
      {:error, "rflex option limits.max_turn: expected what the body can do, 0.9, got 2.0"}
  """
  @spec refuse(String.t(), [atom()], term(), allowed :: String.t()) :: {:error, String.t()}
  def refuse(subject, path, value, allowed) do
    {:error, [{[], text}]} = Wording.refuse(allowed, value)
    {:error, line([{Enum.map(path, &Atom.to_string/1), text}], subject)}
  end

  @doc """
  Problems in one line.

      iex> Hal.Options.line([{["limits", "max_turn"], "is missing"}], "robot")
      "robot option limits.max_turn is missing"
  """
  @spec line([Type.problem(), ...], subject :: String.t()) :: String.t()
  def line([{[], text} | _], subject), do: "#{subject} options: #{text}"

  def line(problems, subject) do
    {told, others} = Enum.split(problems, @told)
    more = if others == [], do: "", else: "; and #{length(others)} more"
    "#{subject} option " <> Enum.map_join(told, "; ", &text/1) <> more
  end

  defp text({path, "expected" <> _ = text}), do: "#{Wording.path(path)}: #{text}"
  defp text({path, text}), do: "#{Wording.path(path)} #{text}"
end
