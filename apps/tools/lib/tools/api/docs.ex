defmodule Tools.Api.Docs do
  @moduledoc "Reads the documentation of a compiled module, with its specs and types, in the order of its source."
  alias Code.Typespec

  @enforce_keys [:name, :summary, :text, :entries]
  defstruct @enforce_keys

  @typedoc """
  Texts are Markdown, empty for none, and `code` are specs, or a type, as source. A function whose last `defaults` arguments
  may be left out has one entry.
  """
  @type entry :: %{
          kind: :type | :callback | :function,
          name: atom(),
          arity: arity(),
          defaults: non_neg_integer(),
          head: String.t(),
          text: String.t(),
          code: [String.t()],
          deprecated: String.t() | nil,
          since: String.t() | nil
        }

  @typedoc "`summary` is the first sentence of `text`."
  @type t :: %__MODULE__{
          name: String.t(),
          summary: String.t(),
          text: String.t(),
          entries: [entry()]
        }

  @kinds %{
    type: :type,
    opaque: :type,
    callback: :callback,
    macrocallback: :callback,
    function: :function,
    macro: :function
  }
  @columns 90

  @doc "The documentation of a module; `nil` for one that has none, which is not public."
  @spec of(module()) :: t() | nil
  def of(module) do
    case Code.fetch_docs(module) do
      {:docs_v1, _line, :elixir, _format, %{"en" => text}, _metadata, docs} ->
        %__MODULE__{
          name: inspect(module),
          summary: summary(text),
          text: text,
          entries: entries(docs, code(module))
        }

      _hidden_or_none ->
        nil
    end
  end

  @doc "Its texts, in an order: the summary, its own, those of its entries."
  @spec texts(t()) :: [String.t()]
  def texts(module),
    do: [module.summary, module.text | for(entry <- module.entries, do: entry.text)]

  @doc "The module with the first of these texts in place of its own, in that order, and the rest."
  @spec take_texts(t(), [String.t()]) :: {t(), [String.t()]}
  def take_texts(module, [summary, text | texts]) do
    {entries, rest} =
      Enum.map_reduce(module.entries, texts, fn entry, [text | rest] ->
        {%{entry | text: text}, rest}
      end)

    {%{module | summary: summary, text: text, entries: entries}, rest}
  end

  defp entries(docs, code) do
    shown =
      for {{_kind, name, _arity}, _line, _heads, doc, _metadata} = entry <- docs,
          doc != :hidden and not match?("_" <> _, Atom.to_string(name)),
          do: entry

    for {{kind, name, arity}, _line, heads, doc, metadata} <- Enum.sort_by(shown, &place/1) do
      kind = Map.fetch!(@kinds, kind)

      %{
        kind: kind,
        name: name,
        arity: arity,
        defaults: Map.get(metadata, :defaults, 0),
        head: List.first(heads) || "#{name}/#{arity}",
        text: if(is_map(doc), do: doc["en"], else: ""),
        code: Map.get(code, {kind, name, arity}, []),
        deprecated: metadata[:deprecated],
        since: metadata[:since]
      }
    end
  end

  defp place({{kind, name, arity}, line, _heads, _doc, _metadata}),
    do: {:erl_anno.line(line), name, arity, kind}

  defp code(module) do
    Map.new(types(module) ++ specs(module, :function) ++ specs(module, :callback))
  end

  defp types(module) do
    for {kind, {name, _type, variables} = type} <- listed(Typespec.fetch_types(module)),
        do: {{:type, name, length(variables)}, [source("@#{kind} ", type(kind, type))]}
  end

  # What an opaque type is made of is nobody's concern.
  defp type(:opaque, type) do
    {:"::", _meta, [head, _made_of]} = Typespec.type_to_quoted(type)
    head
  end

  defp type(_kind, type), do: Typespec.type_to_quoted(type)

  defp specs(module, kind) do
    {listed, word} =
      case kind do
        :function -> {Typespec.fetch_specs(module), "@spec "}
        :callback -> {Typespec.fetch_callbacks(module), "@callback "}
      end

    for {{name, arity}, specs} <- listed(listed) do
      sources = for spec <- specs, do: source(word, Typespec.spec_to_quoted(name, spec))
      {{kind, name, arity}, sources}
    end
  end

  defp listed({:ok, listed}), do: listed
  defp listed(:error), do: []

  defp source(word, quoted) do
    (word <> Macro.to_string(quoted))
    |> Code.format_string!(line_length: @columns)
    |> IO.iodata_to_binary()
  end

  defp summary(text) do
    paragraph = text |> String.split(~r/\n\s*\n/, parts: 2) |> hd()
    paragraph |> String.split(~r/(?<=\.)\s/, parts: 2) |> hd()
  end
end
