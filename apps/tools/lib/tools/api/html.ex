defmodule Tools.Api.Html do
  @moduledoc "Writes the index of modules and the page of each as HTML. Pure: the same documentation gives the same bytes."
  alias Tools.Api.{Docs, Links}

  @type section :: {app :: atom(), room :: String.t(), Docs.t()}

  @doc "The index: modules by app and room in their order, and what each has, which is searched; texts are HTML."
  @spec index([section()]) :: iodata()
  def index(sections) do
    apps =
      for [{app, _room, _module} | _] = all <- Enum.chunk_by(sections, &elem(&1, 0)) do
        rooms = for room <- Enum.chunk_by(all, &elem(&1, 1)), do: room(room)
        ["<section><h2 id=\"", name(app), "\">", name(app), "</h2>\n", rooms, "</section>\n"]
      end

    page("Convoy", [
      "<header><h1>Convoy’s modules</h1>\n",
      ~s(<label id="search" hidden>Search <input type="search"></label>\n),
      ~s(<p id="found" role="status"></p></header>\n<main id="index">\n),
      apps,
      ~s(</main>\n<script src="api.js"></script>\n)
    ])
  end

  defp room([{_app, room, _module} | _] = all) do
    modules = for {_app, _room, module} <- all, do: listed(module)
    heading = if room == "", do: "<span></span>", else: ["<h3>", escape(room), "</h3>"]
    ["<div class=\"room\">", heading, "\n<ul>\n", modules, "</ul></div>\n"]
  end

  defp listed(module) do
    entries = for entry <- module.entries, do: [" ", to_entry(module, entry)]

    [
      ["<li><a href=\"", module.name, ".html\">", module.name, "</a> "],
      [
        "<span>",
        inner(module.summary),
        "</span><span class=\"has\" hidden>",
        entries,
        "</span></li>\n"
      ]
    ]
  end

  defp to_entry(module, entry) do
    anchor = Links.anchor(entry)
    ["<a href=\"", module.name, ".html#", anchor, "\">", escape(anchor), "</a>"]
  end

  @headings [type: "Types", callback: "Callbacks", function: "Functions"]

  @doc "The page of a module, whose texts are HTML."
  @spec module(section(), Links.t()) :: iodata()
  def module({app, room, module}, links) do
    groups =
      for {kind, heading} <- @headings,
          entries = Enum.filter(module.entries, &(&1.kind == kind)),
          entries != [],
          do: {heading, entries}

    where = [
      ~s(<a href="index.html">Modules</a> › <a href="index.html#),
      name(app),
      "\">",
      name(app),
      "</a>"
    ]

    within = if room == "", do: [], else: [" › ", escape(room)]

    page(module.name, [
      ["<header><p>", where, within, "</p>\n<h1>", module.name, "</h1></header>\n"],
      [
        "<div id=\"work\">\n",
        contents(groups),
        "<main>\n",
        Links.text(links, module.name, module.text)
      ],
      for(
        {heading, entries} <- groups,
        do: ["<h2>", heading, "</h2>\n", Enum.map(entries, &entry(&1, module, links))]
      ),
      "</main>\n</div>\n"
    ])
  end

  defp contents([]), do: []

  defp contents(groups) do
    lists =
      for {heading, entries} <- groups do
        items =
          for entry <- entries,
              anchor = Links.anchor(entry),
              do: [
                "<li><a href=\"#",
                anchor,
                "\">",
                escape("#{entry.name}/#{entry.arity}"),
                "</a></li>"
              ]

        ["<h2>", heading, "</h2>\n<ul>", items, "</ul>\n"]
      end

    ["<nav aria-label=\"On this page\">\n", lists, "</nav>\n"]
  end

  defp entry(entry, module, links) do
    anchor = Links.anchor(entry)

    [
      [
        "<section class=\"entry\" id=\"",
        anchor,
        "\">\n<h3><a href=\"#",
        anchor,
        "\">",
        escape(entry.head),
        "</a></h3>\n"
      ],
      for(
        code <- entry.code,
        do: ["<pre><code>", Links.code(links, module.name, escape(code)), "</code></pre>\n"]
      ),
      note("Deprecated: ", entry.deprecated),
      note("Since ", entry.since),
      Links.text(links, module.name, entry.text),
      "</section>\n"
    ]
  end

  defp note(_word, nil), do: []
  defp note(word, text), do: ["<p class=\"note\">", word, escape(text), "</p>\n"]

  defp page(title, body) do
    [
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n",
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n",
      [
        "<title>",
        escape(title),
        "</title>\n<link rel=\"stylesheet\" href=\"api.css\">\n</head>\n<body>\n"
      ],
      body,
      "</body>\n</html>\n"
    ]
  end

  # The words of a paragraph.
  defp inner(html), do: html |> String.trim() |> String.replace(~r{^<p>|</p>$}, "")

  defp name(app), do: Atom.to_string(app)

  defp escape(text) do
    for {sign, entity} <- [{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}],
        reduce: text do
      text -> String.replace(text, sign, entity)
    end
  end
end
