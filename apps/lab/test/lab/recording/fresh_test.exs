defmodule Lab.Recording.FreshTest do
  @moduledoc "A VM that has loaded nothing yet knows all that a recording of this build may say."
  use Lab.LockstepCase, async: true
  alias Lab.{Recorder, Recording, Trial}
  alias Swarm.MissionRegistry
  @moduletag :realtime
  @moduletag :tmp_dir

  # Robots' apps of the build, by their `mix.exs`.
  defp needed(app) do
    mix = File.read!(Path.expand("../../../../#{app}/mix.exs", __DIR__))
    own = for [_all, name] <- Regex.scan(~r/\{:(\w+), in_umbrella: true\}/, mix), do: name
    Enum.flat_map(own, &needed/1) ++ [app]
  end

  defp write(path) do
    robots = [:mag77, :min88]
    {:ok, setup} = Trial.setup(%{robots: robots, seed: 5, blobs: :direct, noise: :slip})
    {:ok, recorder} = Recorder.start_link(path, setup)

    Enum.reduce(1..20, Trial.begin(setup, record: true), fn _tick, trial ->
      Recorder.step(recorder, trial, Trial.step(trial))
    end)

    :ok = Recorder.close(recorder)
  end

  test "it reads a recording, and has loaded all apps of the laboratory", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    write(path)
    vm = Vm.start_one()
    assert {:ok, there} = Vm.call(vm, Recording.File, :open, [path])
    assert {:ok, here} = Recording.File.open(path)
    assert there.setup == here.setup
    assert Vm.call(vm, Enum, :to_list, [Recording.File.ticks(there)]) |> length() == 20

    apps = "lab" |> needed() |> Enum.uniq()
    parts = Vm.call(vm, MissionRegistry, :parts, [[:lab]])
    assert Enum.sort(Enum.map(parts, &to_string/1)) == Enum.sort(apps -- ["vm"])

    for app <- parts, module <- Vm.call(vm, Application, :spec, [app, :modules]) do
      assert {module, Vm.call(vm, :code, :is_loaded, [module])} != {module, false}
    end
  end
end
