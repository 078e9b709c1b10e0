defmodule Tools.Api.Links do
  @moduledoc """
  Finds what is meant by a name in backticks, and where its documentation is: `Swarm`, `Swarm.stop/1`, `c:Robot.Mission.init/2`,
  `t:Hal.Pose.t/0`, `mix replay`; in a module's own documentation also without its name. Pure.
  """
  alias Tools.Api.Docs

  @type t :: %{String.t() => href :: String.t()}

  @doc "All that can be meant."
  @spec new([Docs.t()]) :: t()
  def new(modules) do
    for module <- modules,
        {name, href} <- [own(module) | entries(module)],
        into: %{},
        do: {name, href}
  end

  defp own(%Docs{name: "Mix.Tasks." <> task = name}),
    do: {"mix #{task |> Macro.underscore() |> String.replace("/", ".")}", "#{name}.html"}

  defp own(%Docs{name: name}), do: {name, "#{name}.html"}

  defp entries(%Docs{name: module, entries: entries}) do
    for entry <- entries,
        arity <- (entry.arity - entry.defaults)..entry.arity,
        do:
          {"#{prefix(entry.kind)}#{module}.#{entry.name}/#{arity}",
           "#{module}.html##{anchor(entry)}"}
  end

  defp prefix(:function), do: ""
  defp prefix(:callback), do: "c:"
  defp prefix(:type), do: "t:"

  @doc """
  The anchor of an entry on the page of its module.

      iex> Tools.Api.Links.anchor(%{kind: :callback, name: :init, arity: 2})
      "c:init/2"
  """
  @spec anchor(%{:kind => atom(), :name => atom(), :arity => arity(), optional(atom()) => term()}) ::
          String.t()
  def anchor(entry), do: "#{prefix(entry.kind)}#{entry.name}/#{entry.arity}"

  @doc "Text of a module with its names in backticks as links, in HTML as `cmark` makes it; blocks of code stay as they are."
  @spec text(t(), module :: String.t(), html :: String.t()) :: String.t()
  def text(links, module, html) do
    Regex.replace(~r{<pre>.*?</pre>|<a .*?</a>|<code>([^<]*)</code>}s, html, fn
      whole, "" -> whole
      whole, name -> linked(whole, find(links, module, name))
    end)
  end

  @doc "A spec or a type, which is escaped, with links to the types that it names."
  @spec code(t(), module :: String.t(), escaped :: String.t()) :: String.t()
  def code(links, module, escaped) do
    Regex.replace(~r/(?<![\w.:])((?:[A-Z]\w*\.)*[a-z_]\w*)\(\)/, escaped, fn whole, name ->
      linked(whole, find(links, module, "t:#{name}/0"))
    end)
  end

  defp linked(html, nil), do: html
  defp linked(html, href), do: ~s(<a href="#{href}">#{html}</a>)

  # A page needs no link to itself.
  defp find(links, module, name) do
    href = links[name] || links[own_name(module, name)]
    if href != "#{module}.html", do: href
  end

  defp own_name(module, <<prefix::binary-size(2), name::binary>>) when prefix in ["c:", "t:"],
    do: "#{prefix}#{module}.#{name}"

  defp own_name(module, name), do: "#{module}.#{name}"
end
