defmodule Missions.InterfaceTest do
  @moduledoc "Missions call what docs/missions.md allows to any mission, and none of it waits, sends, or knows the time."
  use ExUnit.Case, async: true
  @guide Path.expand("../../../../docs/missions.md", __DIR__)

  # Modules that only a process would call, and functions of :erlang that only a process would.
  @impure [GenServer, Process, Agent, Task, File, IO, Port, System, Registry, Logger] ++
            [
              :gen_server,
              :gen_statem,
              :ets,
              :persistent_term,
              :rand,
              :file,
              :gen_tcp,
              :timer,
              :os
            ]
  @impure_bifs ~w(send send_after start_timer self spawn spawn_link monitor whereis now monotonic_time
                  system_time unique_integer make_ref put get erase process_info nodes node open_port)a

  defp calls(module) do
    {^module, beam, _path} = :code.get_object_code(module)
    {:ok, {^module, [imports: imports]}} = :beam_lib.chunks(beam, [:imports])
    imports
  end

  # Without those that only tests have.
  defp modules(app) do
    {:ok, all} = :application.get_key(app, :modules)
    Enum.filter(all, &(to_string(&1.module_info(:compile)[:source]) =~ "/apps/#{app}/lib/"))
  end

  # The first column of the table: modules, and families of them as `Swarm.Formation.*`.
  defp allowed do
    rows =
      @guide
      |> File.read!()
      |> String.split(~r/^## /m)
      |> Enum.find(&(&1 =~ "What a mission may call"))

    for [_all, name] <- Regex.scan(~r/^\| `([A-Z][\w.]*(?:\.\*)?)` \|/m, rows), do: name
  end

  defp allowed?(module, allowed) do
    name = inspect(module)

    Enum.any?(allowed, fn entry ->
      case String.split(entry, ".*") do
        [family, ""] -> name == family or String.starts_with?(name, family <> ".")
        [^name] -> true
        _other -> false
      end
    end)
  end

  test "all that the missions in the box call outside of themselves is in the guide's table, and nothing else is there" do
    ours = Enum.flat_map([:hal, :nav, :robot, :vision, :mesh, :swarm], &modules/1)
    allowed = allowed()

    called =
      for mission <- modules(:missions),
          {module, _f, _a} <- calls(mission),
          module in ours,
          uniq: true,
          do: module

    assert called != []
    assert for(module <- called, not allowed?(module, allowed), do: module) == []

    # A row that names nothing is a mistake in the guide.
    for entry <- allowed, do: assert(Enum.any?(ours, &allowed?(&1, [entry])), entry)
  end

  test "neither missions nor what they call wait, send, read or know the time" do
    called =
      for mission <- modules(:missions),
          {module, _f, _a} <- calls(mission),
          match?("Elixir." <> _, Atom.to_string(module)),
          allowed?(module, allowed()) or module in modules(:missions),
          uniq: true,
          do: module

    wrong =
      for module <- Enum.uniq(called ++ modules(:missions)),
          {m, f, a} <- calls(module),
          m in @impure or (m == :erlang and f in @impure_bifs),
          do: {module, {m, f, a}}

    assert wrong == []
  end
end
