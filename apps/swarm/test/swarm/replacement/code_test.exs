defmodule Swarm.Replacement.CodeTest do
  @moduledoc "Modules are loaded into this VM: each test has names of its own."
  use ExUnit.Case, async: true
  alias Swarm.Replacement
  alias Swarm.Replacement.Order
  alias Swarm.Versions

  # Object code that was never loaded, whatever its name.
  defp beam(module, options \\ []) do
    forms = [
      {:attribute, 1, :module, module},
      {:attribute, 1, :export, [value: 0, held: 1]},
      {:function, 2, :value, 0, [clause({:integer, 2, options[:value] || 1})]},
      # It is still there when what it calls returns.
      {:function, 3, :held, 1,
       [
         {:clause, 3, [{:var, 3, :X}], [],
          [{:tuple, 3, [{:call, 3, {:var, 3, :X}, []}, {:integer, 3, 1}]}]}
       ]}
    ]

    mission =
      if Keyword.get(options, :mission?, true), do: [{:attribute, 1, :behaviour, Robot.Mission}]

    on_load = if options[:on_load?], do: [{:attribute, 1, :on_load, {:value, 0}}]
    forms = List.insert_at(forms, 1, List.wrap(mission) ++ List.wrap(on_load)) |> List.flatten()
    {:ok, ^module, beam} = :compile.forms(forms, [])
    beam
  end

  defp clause(body), do: {:clause, 2, [], [], [body]}
  defp value(module), do: module.value()

  defp order(mission, modules) do
    code = for {module, beam} <- modules, do: {Atom.to_string(module), beam}

    %Order{
      id: <<0::128>>,
      from: "base",
      to: ["mag1"],
      mission: Atom.to_string(mission),
      options: Order.encode_options([]),
      code: code
    }
  end

  defp check(mission, modules, loaded \\ %{}, kept \\ %{}),
    do: Replacement.Code.check(order(mission, modules), loaded, kept)

  test "a mission that nobody has, with modules below its name, may come, and goes without a trace" do
    modules = [
      {Ours.Code1, beam(Ours.Code1)},
      {Ours.Code1.Part, beam(Ours.Code1.Part, mission?: false)}
    ]

    assert {:ok, Ours.Code1, ^modules, earlier} = check(Ours.Code1, modules)
    assert Enum.sort(earlier) == [{Ours.Code1, :absent}, {Ours.Code1.Part, :absent}]

    assert Replacement.Code.load(modules) == :ok
    assert {value(Ours.Code1), value(Ours.Code1.Part)} == {1, 1}
    assert Replacement.Code.restore(earlier) == :ok
    refute :erlang.module_loaded(Ours.Code1) or :erlang.module_loaded(Ours.Code1.Part)
  end

  test "a newer version replaces one that came before, and that one comes back" do
    first = [{Ours.Code2, beam(Ours.Code2)}]
    {:ok, _mission, ^first, _absent} = check(Ours.Code2, first)
    :ok = Replacement.Code.load(first)
    # Who has not brought it must not replace it: nobody knows what to bring back.
    second = [{Ours.Code2, beam(Ours.Code2, value: 2)}]
    assert {:error, line} = check(Ours.Code2, second)
    assert line == "Ours.Code2 is loaded from no file of a mission's application"

    {:ok, _mission, ^second, earlier} = check(Ours.Code2, second, Map.new(first))
    :ok = Replacement.Code.load(second)
    assert value(Ours.Code2) == 2
    :ok = Replacement.Code.restore(earlier)
    assert value(Ours.Code2) == 1
    :ok = Replacement.Code.restore([{Ours.Code2, :absent}])
  end

  test "what carries the robot is never replaced, nor a library" do
    for {module, app} <- [
          {Robot.Safety.Gate, :robot},
          {Robot.Mission.Manual, :robot},
          {Swarm.Member, :swarm},
          {Hal.RFlex.Driver, :hal},
          {Mesh.Secret, :mesh},
          {Enum, :elixir},
          {:lists, :stdlib}
        ] do
      assert check(module, [{module, beam(module)}]) ==
               {:error, "#{inspect(module)} belongs to #{app}, which no order replaces"}
    end

    # Not as a part of a mission either, and not by way of one that claims the name above it.
    inside = [{Swarm.Estop, beam(Swarm.Estop)}, {Swarm.Member, beam(Swarm.Member)}]
    assert check(Swarm.Estop, inside) == {:error, "Swarm.Member is not below Swarm.Estop"}
    above = [{Robot, beam(Robot)}, {Robot.Safety.Gate, beam(Robot.Safety.Gate)}]
    assert {:error, line} = check(Robot, above)
    assert line =~ "which no order replaces"

    assert {:error, _no_file} =
             check(Swarm.StandMission, [{Swarm.StandMission, beam(Swarm.StandMission)}])
  end

  test "code that is not what its order says is refused" do
    ours = {Ours.Code3, beam(Ours.Code3)}

    for {modules, line} <- [
          {[{Ours.Code3, beam(Ours.Code3Other)}],
           "the code of Ours.Code3 is not the object code of that module"},
          {[{Ours.Code3, "junk"}],
           "the code of Ours.Code3 is not the object code of that module"},
          {[{Ours.Code3.Part, beam(Ours.Code3.Part)}],
           "the code of Ours.Code3 itself is missing"},
          {[{Ours.Code3, beam(Ours.Code3, mission?: false)}],
           "Ours.Code3 is not a Robot.Mission"},
          {[ours, {Ours.Code3Part, beam(Ours.Code3Part)}],
           "Ours.Code3Part is not below Ours.Code3"}
        ] do
      assert check(Ours.Code3, modules) == {:error, line}
    end

    assert check(Ours.Code3, []) == {:error, "Ours.Code3 is not a mission of this build"}
    assert {:ok, Swarm.StandMission, [], []} = check(Swarm.StandMission, [])
    refute :erlang.module_loaded(Ours.Code3)
  end

  test "code that runs when it is loaded, and code whose old version is in use, is not loaded, nor is any with it" do
    modules = [
      {Ours.Code4, beam(Ours.Code4)},
      {Ours.Code4.Part, beam(Ours.Code4.Part, on_load?: true)}
    ]

    assert Replacement.Code.load(modules) ==
             {:error, "Ours.Code4.Part cannot be loaded: :on_load_not_allowed"}

    refute :erlang.module_loaded(Ours.Code4)

    :ok = Replacement.Code.load([{Ours.Code4, beam(Ours.Code4)}])
    test = self()

    held =
      spawn_link(fn ->
        wait = fn -> send(test, :held) && receive(do: (:go_on -> :ok)) end
        send(test, Function.capture(Ours.Code4, :held, 1).(wait))
      end)

    assert_receive :held, 10_000
    :ok = Replacement.Code.load([{Ours.Code4, beam(Ours.Code4, value: 2)}])
    third = [{Ours.Code4, beam(Ours.Code4, value: 3)}]
    assert Replacement.Code.load(third) == {:error, "old code of Ours.Code4 is still in use"}
    assert value(Ours.Code4) == 2
    send(held, :go_on)
    assert_receive {:ok, 1}, 10_000
  end

  test "the code of a mission is read from its files, with what is below it and without what is not executed" do
    assert {:ok, Swarm.StandMission, [{"Elixir.Swarm.StandMission", read}]} =
             Replacement.Code.read(Swarm.StandMission)

    {_module, beam, _file} = :code.get_object_code(Swarm.StandMission)
    assert byte_size(read) < div(byte_size(beam), 2)
    assert :beam_lib.md5(read) == :beam_lib.md5(beam)

    code = Versions.code(Ours.Code5, 1, :push)

    assert {:ok, Ours.Code5, [{"Elixir.Ours.Code5", _}, {"Elixir.Ours.Code5.Push", _}]} =
             Replacement.Code.read(code)

    assert {:ok, _mission, modules, _earlier} = check(Ours.Code5, code)
    assert Keyword.keys(modules) == Keyword.keys(code)

    two = code ++ Versions.code(Ours.Code6, 1)
    assert Replacement.Code.read(two) == {:error, "more than one mission: Ours.Code5, Ours.Code6"}

    assert Replacement.Code.read([{Ours.Code5, "junk"}]) ==
             {:error, "the code cannot be read: it is no object code"}

    for wrong <- [[], [:a], [{:a, 1}], [{Ours.Code5, "junk"} | :a], 7, nil, "text"],
        do: assert({:error, "code: expected " <> _} = Replacement.Code.read(wrong))
  end
end
