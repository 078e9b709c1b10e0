defmodule Player.Render do
  @moduledoc "Writes the text of a robot file from an imported Player configuration. Pure."
  alias Player.{State, Writer}

  @order [:id, :profile, :body, :drive, :ptz, :camera, :colours, :limits, :start, :policies]

  @doc """
  The text of the robot file: comments on its source and on what was assumed, then all keys;
  `modules` are the drivers.
  """
  @spec write(State.t(), Path.t(), atom(), atom(), %{atom() => module()}) :: String.t()
  def write(state, file, id, profile, modules) do
    nested =
      Enum.reduce(state.values, [], fn {path, value, _, _}, all -> nest(all, path, value) end)

    known = %{id: id, profile: profile, start: {0.0, 0.0, {:deg, 0.0}}}

    keys =
      for key <- @order, value = known[key] || key(key, nested[key], modules), do: {key, value}

    Writer.text(head(file, state), keys)
  end

  defp key(kind, options, modules) when is_map_key(modules, kind),
    do: options && {modules[kind], options}

  defp key(_key, value, _modules), do: value

  defp head(file, state) do
    assumed =
      for {line, what, why} <- Enum.sort(state.assumed), do: "  line #{line}, #{what}: #{why}"

    lines =
      [
        "From #{Path.basename(file)}, a configuration of the Player device server.",
        "mix robot.check shows what it says; template.exs explains all keys."
      ] ++ if(assumed == [], do: [], else: ["", "Assumed:" | assumed])

    # A comment must not contain what would end it.
    Enum.map(lines, &String.replace(&1, ~r/[^\x20-\x7E]/, "?"))
  end

  # In the order of the lines of Player's file.
  defp nest(all, [key], value), do: all ++ [{key, value}]

  defp nest(all, [key | path], value) do
    inner = nest(Keyword.get(all, key, []), path, value)

    if Keyword.has_key?(all, key),
      do: Keyword.replace!(all, key, inner),
      else: all ++ [{key, inner}]
  end
end
