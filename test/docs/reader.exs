defmodule Docs.Reader do
  @moduledoc """
  What the documents tell people to type, and what they show for an answer. Pure.

  The conventions of the documents:

    * in a block (four spaces), a line that begins with a program is a command of the shell, and one that ends
      with `\\` goes on in the next; other lines below it are what it prints
    * `iex>`, or `iex(mag1@convoy)1>`, begins a line of a shell of ours, and the lines below it, up to an empty
      one, are what that prints
    * `> ` begins what is typed at the prompt of the demo
    * a block fenced with a word and a path (`elixir apps/mine/lib/square.ex`) is a file that the reader writes
    * all else in a block is shown only, and so is what is fenced with another word than `elixir`
    * in a block fenced with `elixir`, a remark alone on the lines below an expression is its value
    * `` `in a sentence` `` a command or the name of a function is a mention
    * `…` stands for anything (in an answer of `iex>`, see `Docs.Shown`); where a robot's status is printed (`#mag1 …`), so do numbers for numbers
  """

  @type item ::
          {:shell | :iex | :prompt | :shown | :mention | :elixir, line :: pos_integer(),
           text :: String.t(), answer :: String.t()}
          | {:file, line :: pos_integer(), path :: Path.t(), text :: String.t()}

  @programs ~w(cd mix iex apt-get ssh scp cp sed erl ffmpeg nft robot kill mkdir printf)

  @doc "All items of a document, in order."
  @spec items(String.t()) :: [item()]
  def items(text) do
    text
    |> String.split("\n")
    |> Enum.with_index(1)
    |> blocks()
    |> Enum.flat_map(&read/1)
  end

  defp blocks([]), do: []

  defp blocks([{"```" <> word, _n} | rest]) do
    {inside, [_end | rest]} = Enum.split_while(rest, &(not match?({"```" <> _, _}, &1)))
    [{:fenced, word, inside} | blocks(rest)]
  end

  defp blocks([{"    " <> _, _n} | _] = lines) do
    {inside, rest} = Enum.split_while(lines, fn {line, _n} -> line =~ ~r/^(    .*|\s*)$/ end)
    [{:indented, inside} | blocks(rest)]
  end

  defp blocks([line | rest]), do: [{:sentence, line} | blocks(rest)]

  defp read({:sentence, {line, n}}) do
    for [_all, code] <- Regex.scan(~r/`([^`]+)`/, line), do: {:mention, n, code, ""}
  end

  defp read({:fenced, "elixir", [{_line, n} | _] = lines}),
    do: [{:elixir, n, Enum.map_join(lines, "\n", &elem(&1, 0)), ""}]

  defp read({:fenced, word, [{line, n} | _] = lines}) do
    case String.split(word) do
      [_language, path] -> [{:file, n, path, Enum.map_join(lines, &(elem(&1, 0) <> "\n"))}]
      _word -> [{:shown, n, line, ""}]
    end
  end

  defp read({:indented, lines}) do
    lines = for {line, n} <- lines, do: {String.replace_prefix(line, "    ", ""), n}
    lines |> typed(nil, []) |> Enum.reverse() |> Enum.map(&trim/1)
  end

  # `open` says which kind of item takes the lines that are no beginning.
  defp typed([], _open, items), do: items

  defp typed([{line, n} | rest], open, items) do
    cond do
      match = Regex.run(~r/^iex(?:\([^)]*\)\d*)?> (.*)$/, line) ->
        typed(rest, :iex, [{:iex, n, List.last(match), ""} | items])

      open == :iex and line =~ ~r/^\.\.\.(\([^)]*\)\d*)?> / ->
        [{:iex, at, code, ""} | before] = items

        typed(rest, :iex, [
          {:iex, at, code <> "\n" <> String.replace(line, ~r/^.*?> /, ""), ""} | before
        ])

      match = Regex.run(~r/^> (.*)$/, line) ->
        typed(rest, :prompt, [{:prompt, n, List.last(match), ""} | items])

      command?(line) ->
        {more, rest} = Enum.split_while([{line, n} | rest], &(elem(&1, 0) =~ ~r/\\$/))
        [last | rest] = rest
        command = Enum.map_join(more ++ [last], "\n", &elem(&1, 0))
        typed(rest, :shell, [{:shell, n, command, ""} | items])

      String.trim(line) == "" and open in [:iex, :prompt] ->
        typed(rest, nil, items)

      String.trim(line) == "" and open == nil ->
        typed(rest, nil, items)

      open in [:iex, :shell, :shown] ->
        [{kind, at, text, answer} | before] = items
        typed(rest, open, [{kind, at, text, answer <> line <> "\n"} | before])

      true ->
        typed(rest, :shown, [{:shown, n, line, ""} | items])
    end
  end

  defp trim({kind, n, text, answer}), do: {kind, n, String.trim(text), String.trim(answer)}

  @doc "Whether a line is a command of the shell."
  @spec command?(String.t()) :: boolean()
  def command?(line) do
    case Regex.run(~r/^(?:\((?:umask 077; )?|[A-Z_]+=\S+ +)*([\w.\/-]+)(?=[\s;]|$)/, line) do
      [_all, "bin/" <> _] -> true
      [_all, "_build/" <> _] -> String.contains?(line, " ")
      [_all, "rel/" <> _] -> not (line =~ ~r/^rel\/\S+\.\w+$/)
      [_all, word] -> word in @programs and String.contains?(line, " ")
      nil -> false
    end
  end

  @doc "A command's words, without remark, variables before it, and what comes of its output."
  @spec words(String.t()) :: [String.t()]
  def words(command) do
    command
    |> String.replace("\\\n", " ")
    |> String.replace(~r/\s#.*$/, "")
    |> String.split(~r/;| [|>] /)
    |> hd()
    |> OptionParser.split()
    |> Enum.drop_while(&(&1 =~ ~r/^[A-Z_]+=/))
  end

  @doc "Whether what was printed is what the document shows, compared as text."
  @spec like?(String.t(), String.t()) :: boolean()
  def like?(shown, printed) do
    {shown, printed} = plain(shown, printed)
    pattern = shown |> String.split("…") |> Enum.map_join(".*", &Regex.escape/1)
    printed =~ Regex.compile!("\\A#{pattern}\\z", "su")
  end

  @doc """
  Both texts without what a document does not promise: how wide a terminal is, where lines end for it, and the
  numbers of a robot's status.
  """
  @spec plain(String.t(), String.t()) :: {String.t(), String.t()}
  def plain(shown, printed) do
    numbers? = shown =~ ~r/(^|\s|\[)#(\w+\d |Swarm\.Membership\.Matrix)/
    {plain_text(shown, numbers?), plain_text(printed, numbers?)}
  end

  defp plain_text(text, numbers?) do
    text = text |> String.replace(~r/\s+/, " ") |> String.replace(~r/ ?([\[\]{}(),|]) ?/, "\\1")
    text = String.trim(text)
    if numbers?, do: String.replace(text, ~r/(?<![\w.])-?\d+(\.\d+)?(?!\w)/, "0"), else: text
  end
end
