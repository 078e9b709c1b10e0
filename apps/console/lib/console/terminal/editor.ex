defmodule Console.Terminal.Editor do
  @moduledoc false
  # Edits a line, key by key: moving, deleting, history, completion. Pure.
  #
  # The view draws it, so the terminal itself must not echo. A line ends at `:most` bytes and a
  # character beyond them, so that its reader sees that it was longer; the rest is dropped.

  defstruct before: "",
            behind: "",
            history: [],
            older: [],
            newer: [],
            escape: nil,
            words: nil,
            most: 500

  @type t :: %__MODULE__{}

  @doc """
  Handles one character. Besides the editor it returns a finished line, the wish to leave, the emergency stop (F8), or
  the possible completions of the word at the cursor.

      iex> editor = Console.Terminal.Editor.new(["kill"])
      iex> {nil, editor} = Console.Terminal.Editor.key(editor, "k")
      iex> {nil, editor} = Console.Terminal.Editor.key(editor, "\\t")
      iex> Console.Terminal.Editor.text(editor)
      "kill "
      iex> {line, _editor} = Console.Terminal.Editor.key(editor, "\\r")
      iex> line
      {:line, "kill "}
  """
  @spec key(t(), String.t()) ::
          {nil | {:line, String.t()} | {:choices, [String.t()]} | :quit | :estop, t()}
  def key(%__MODULE__{escape: nil} = editor, "\e"), do: {nil, %{editor | escape: ""}}

  def key(%__MODULE__{escape: escape} = editor, char) when is_binary(escape) do
    case escape <> char do
      "[" ->
        {nil, %{editor | escape: "["}}

      "O" ->
        {nil, %{editor | escape: "["}}

      "[19~" ->
        {:estop, %{editor | escape: nil}}

      "[" <> rest = sequence ->
        if rest =~ ~r/[A-Za-z~]$/,
          do: {nil, move(%{editor | escape: nil}, rest)},
          else: {nil, %{editor | escape: sequence}}

      _other ->
        {nil, %{editor | escape: nil}}
    end
  end

  def key(editor, enter) when enter in ["\r", "\n"], do: finish(editor)
  def key(editor, <<3>>), do: {:quit, editor}
  def key(%{before: "", behind: ""} = editor, <<4>>), do: {:quit, editor}

  def key(editor, delete) when delete in [<<127>>, "\b"],
    do: {nil, %{editor | before: String.slice(editor.before, 0..-2//1)}}

  def key(editor, <<1>>), do: {nil, move(editor, "H")}
  def key(editor, <<5>>), do: {nil, move(editor, "F")}
  def key(editor, <<11>>), do: {nil, %{editor | behind: ""}}
  def key(editor, <<21>>), do: {nil, %{editor | before: ""}}

  def key(editor, <<23>>),
    do: {nil, %{editor | before: String.replace(editor.before, ~r/\S*\s*$/, "")}}

  def key(editor, "\t"), do: complete(editor)

  def key(editor, char) do
    if String.printable?(char) and
         byte_size(editor.before) + byte_size(editor.behind) <= editor.most,
       do: {nil, %{editor | before: editor.before <> char}},
       else: {nil, editor}
  end

  @doc """
  An editor that completes these words, or those that a function returns for the words before the
  cursor.
  """
  @spec new([String.t()] | ([String.t()] -> [String.t()])) :: t()
  def new(words) when is_list(words), do: new(fn _before -> words end)
  def new(words), do: %__MODULE__{words: words}

  @doc "The whole line."
  @spec text(t()) :: String.t()
  def text(editor), do: editor.before <> editor.behind

  @doc "The number of characters before the cursor."
  @spec cursor(t()) :: non_neg_integer()
  def cursor(editor), do: String.length(editor.before)

  defp finish(editor) do
    line = text(editor)
    history = if String.trim(line) == "", do: editor.history, else: [line | editor.history]
    {{:line, line}, %{new(editor.words) | history: history, older: history, most: editor.most}}
  end

  defp move(%{older: [line | older]} = editor, "A"),
    do: %{editor | before: line, behind: "", older: older, newer: [text(editor) | editor.newer]}

  defp move(%{newer: [line | newer]} = editor, "B"),
    do: %{editor | before: line, behind: "", newer: newer, older: [text(editor) | editor.older]}

  defp move(%{behind: <<next::utf8, rest::binary>>} = editor, "C"),
    do: %{editor | before: editor.before <> <<next::utf8>>, behind: rest}

  defp move(%{before: before} = editor, "D") when before != "" do
    {before, last} = String.split_at(before, -1)
    %{editor | before: before, behind: last <> editor.behind}
  end

  defp move(editor, home) when home in ["H", "1~"],
    do: %{editor | before: "", behind: text(editor)}

  defp move(editor, last) when last in ["F", "4~"],
    do: %{editor | before: text(editor), behind: ""}

  defp move(%{behind: <<_::utf8, rest::binary>>} = editor, "3~"), do: %{editor | behind: rest}
  defp move(editor, _other), do: editor

  defp complete(editor) do
    [stem | earlier] = editor.before |> String.split(" ") |> Enum.reverse()
    earlier = earlier |> Enum.reverse() |> Enum.reject(&(&1 == ""))

    case Enum.filter(editor.words.(earlier), &String.starts_with?(&1, stem)) do
      [] -> {nil, editor}
      [only] -> {nil, put(editor, stem, only <> " ")}
      several -> several(editor, stem, several)
    end
  end

  # Completes as far as all candidates agree; lists them only after that.
  defp several(editor, stem, words) do
    case String.slice(hd(words), 0, :binary.longest_common_prefix(words)) do
      ^stem -> {{:choices, words}, editor}
      longer -> {nil, put(editor, stem, longer)}
    end
  end

  defp put(editor, stem, word) do
    kept = String.slice(editor.before, 0, String.length(editor.before) - String.length(stem))
    %{editor | before: kept <> word}
  end
end
