defmodule Bench.Command do
  @moduledoc "Runs a command `mix bench NAME`: reads its options by its table, or prints its help."
  alias Console.Cli.{Arguments, MapName}

  @doc "Measures with the options given, by their names; each error is one line. `more` ends the help."
  @spec run([String.t()], String.t(), [Arguments.option()], (map() -> result), more :: String.t()) ::
          result | :ok | {:error, [String.t()]}
        when result: term()
  def run(arguments, name, table, measure, more \\ "") do
    with {:ok, pairs} <- Arguments.parse(arguments, table) do
      given = Map.new(pairs)

      if given["help"],
        do: IO.puts("  mix bench #{name} [options]\n\n#{Arguments.help(table)}#{more}"),
        else: measure.(given)
    end
  end

  @doc "The option `maps`: which maps, if not these."
  @spec maps([String.t(), ...]) :: Arguments.option()
  def maps(usual) do
    says = "which maps: names, FILE.yaml, FILE.png:WIDTHxHEIGHT or FILE.pgm:…"
    {"maps", "NAME,NAME", &MapName.list/1, "#{says}\n(#{Enum.join(usual, ",")})"}
  end

  @doc "The cases of a bench, for its help."
  @spec cases([%{:name => atom(), :says => String.t(), optional(atom()) => term()}]) :: String.t()
  def cases(cases),
    do:
      "\n\nCases\n" <>
        Enum.map_join(cases, "\n", &"  #{String.pad_trailing("#{&1.name}", 10)}#{&1.says}")
end
