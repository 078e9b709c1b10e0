defmodule Tools.Api do
  @moduledoc "Writes the documentation of the public modules as HTML: `mix api`."
  alias Tools.Api.{Docs, Html, Links, Rooms}

  @root Path.expand("../../../..", __DIR__)
  @table Path.join(@root, "docs/modules.md")
  @external_resource @table
  @rooms Rooms.table(File.read!(@table))

  @shared for name <- ["api.css", "api.js"], do: Path.join(@root, "apps/tools/assets/#{name}")
  for path <- @shared, do: @external_resource(path)
  @files for path <- @shared, do: {Path.basename(path), File.read!(path)}

  @doc """
  Writes `index.html`, a page for each public module, style and script into a folder, which is made if needed; returns how
  many modules there are. `program` makes HTML of Markdown. The error is one line: the program is missing, a file
  cannot be written, the text of a module ends inside a block.
  """
  @spec write(Path.t(), program :: String.t()) ::
          {:ok, modules :: non_neg_integer()} | {:error, line :: String.t()}
  def write(folder, program \\ "cmark-gfm") do
    with {:ok, program} <- found(program),
         :ok <- explain(folder, File.mkdir_p(folder)),
         {:ok, sections} <- rendered(sections(), program, folder) do
      links = Links.new(for {_app, _room, module} <- sections, do: module)

      pages =
        for {_app, _room, module} = section <- sections,
            do: {"#{module.name}.html", Html.module(section, links)}

      with :ok <- put_all(folder, [{"index.html", Html.index(sections)} | pages] ++ @files),
           do: {:ok, length(sections)}
    end
  end

  defp found(name) do
    case System.find_executable(name) do
      nil -> {:error, "#{name} is not installed (on Debian: cmark-gfm)"}
      program -> {:ok, program}
    end
  end

  # Apps and rooms in the order of the table, in a room by name. What is the app itself comes first, its tasks for Mix last.
  defp sections do
    for {app, rooms} <- @rooms,
        _loaded = Application.load(app),
        rooms = ["" | rooms] ++ ["mix"],
        modules = Enum.sort(Application.spec(app, :modules)),
        room <- rooms,
        module <- modules,
        Rooms.room(app, module) == room,
        documented = Docs.of(module),
        do: {app, room, documented}
  end

  # All texts at once: a program for each would take a minute.
  defp rendered(sections, program, folder) do
    texts = for {_app, _room, module} <- sections, text <- Docs.texts(module), do: text
    path = Path.join(folder, "api.md")

    with :ok <- put(folder, {"api.md", marked(texts)}),
         {html, 0} = System.cmd(program, ["--extension", "table", "--to", "html", path]),
         :ok <- explain(path, File.rm(path)),
         {:ok, texts} <- divided(length(texts), html) do
      {sections, []} =
        Enum.map_reduce(sections, texts, fn {app, room, module}, texts ->
          {module, texts} = Docs.take_texts(module, texts)
          {{app, room, module}, texts}
        end)

      {:ok, sections}
    end
  end

  # After each text a paragraph that no text has.
  defp marked(texts),
    do: for({text, k} <- Enum.with_index(texts), do: [text, "\n\n", mark(k), "\n\n"])

  defp mark(k), do: "%%% #{k} %%%"

  defp divided(count, html) do
    texts = Regex.split(~r{<p>%%% \d+ %%%</p>\n}, html)

    if length(texts) == count + 1,
      do: {:ok, Enum.take(texts, count)},
      else: {:error, "a text ends inside a block, of which the end is missing"}
  end

  defp put_all(folder, files) do
    Enum.reduce_while(files, :ok, fn file, :ok ->
      with :ok <- put(folder, file), do: {:cont, :ok}, else: (error -> {:halt, error})
    end)
  end

  defp put(folder, {name, content}) do
    path = Path.join(folder, name)
    explain(path, File.write(path, content))
  end

  defp explain(_path, :ok), do: :ok

  defp explain(path, {:error, reason}),
    do: {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}
end
