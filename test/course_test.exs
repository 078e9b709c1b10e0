defmodule System.CourseTest do
  @moduledoc "The graded exercises of docs/exercises.md: what is asked can be done, and is not given for nothing."
  use ExUnit.Case, async: false
  alias Lab.Scenario
  alias Lab.Scenario.Runner

  @course Path.expand("../examples/course", __DIR__)
  @exercises [tour: :behaviours, line_up: :missions, posts: :missions, relay: :missions]

  setup_all do
    modules =
      for file <- Path.wildcard(Path.join(@course, "solutions/*.ex")),
          {module, _code} <- Code.compile_file(file),
          do: module

    on_exit(fn ->
      for module <- modules do
        :code.purge(module)
        :code.delete(module)
      end
    end)
  end

  test "each exercise has a scenario and a solution, and a row" do
    names = for {name, _kind} <- @exercises, do: Atom.to_string(name)
    assert stems("*.exs") == Enum.sort(names)
    assert stems("solutions/*.ex") == Enum.sort(names)
    rows = File.read!(Path.expand("../docs/exercises.md", __DIR__))
    for name <- names, do: assert(rows =~ "| `#{name}` |")
  end

  defp stems(pattern) do
    for file <- Path.wildcard(Path.join(@course, pattern)),
        do: file |> Path.basename() |> Path.rootname()
  end

  for {name, kind} <- @exercises do
    @name name
    @kind kind

    test "#{name}: the solution passes, and without one it is refused" do
      file = Path.join(@course, "#{@name}.exs")
      assert {:error, [line]} = Scenario.File.load(file)
      assert line =~ ~r/behaviour "#{@name}" is not known|got :#{@name}$/

      module = Module.concat(Course, Macro.camelize(Atom.to_string(@name)))
      assert with_name(@kind, [{@name, module}], fn -> failed(file) end) == []
    end
  end

  test "a robot that does nothing passes none" do
    for {name, :missions} <- @exercises do
      file = Path.join(@course, "#{name}.exs")
      # `teleop` waits for a person.
      failed = with_name(:missions, [{name, Missions.Teleop}], fn -> failed(file) end)
      assert Enum.any?(failed, &match?({:at, _, _, _}, &1))
    end

    idle = [tour: Robot.Behaviour.Rest]
    assert with_name(:behaviours, idle, fn -> failed(Path.join(@course, "tour.exs")) end) != []
  end

  defp with_name(kind, names, function) do
    before = Application.get_env(:swarm, kind, [])
    Application.put_env(:swarm, kind, before ++ names)

    try do
      function.()
    after
      Application.put_env(:swarm, kind, before)
    end
  end

  defp failed(file) do
    {:ok, scenario} = Scenario.File.load(file)
    {:ok, _result, verdicts} = Runner.run(scenario)
    for verdict <- verdicts, not verdict.held?, do: verdict.expectation
  end
end
