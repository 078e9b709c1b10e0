defmodule Tools.Api.Rooms do
  @moduledoc "Says which room of its app a module is in, and the order of rooms, by the table of `docs/modules.md`. Pure."

  @doc """
  The apps and their rooms, in their order.

      iex> Tools.Api.Rooms.table("## Rooms inside an app\\n\\n| `vm` | `fleet`, `net` |\\n\\n## Modules\\n")
      [vm: ["fleet", "net"]]
  """
  @spec table(modules_md :: String.t()) :: [{app :: atom(), rooms :: [String.t()]}]
  def table(text) do
    [_before, section] = String.split(text, "## Rooms", parts: 2)
    [section | _after] = String.split(section, "\n## ", parts: 2)

    for [_row, app, rooms] <- Regex.scan(~r/^\| `(\w+)` \| (.*) \|$/m, section),
        do: {String.to_atom(app), for([_all, room] <- Regex.scan(~r/`(\w+)`/, rooms), do: room)}
  end

  @doc """
  The room of a compiled module of this app; the app itself (`Swarm`) is in `""`, its tasks for Mix are in `"mix"`, and
  what is not in its `lib` is in none (`nil`).

      iex> Tools.Api.Rooms.room(:tools, Tools.Replay.Options)
      "replay"
      iex> Tools.Api.Rooms.room(:tools, Mix.Tasks.Replay)
      "mix"
      iex> Tools.Api.Rooms.room(:tools, Enum)
      nil
  """
  @spec room(app :: atom(), module()) :: String.t() | nil
  def room(app, module) do
    source = to_string(module.module_info(:compile)[:source])

    with [_all, rest] <- Regex.run(~r"/apps/#{app}/lib/(.+)\.ex$", source),
         do: rest |> String.split("/") |> of_path(Atom.to_string(app))
  end

  # A room may have modules of its own name, such as `Mcap`, in a folder beside the app's.
  defp of_path([app, room | _], app), do: room
  defp of_path([app], app), do: ""
  defp of_path([room | _], _app), do: room
end
