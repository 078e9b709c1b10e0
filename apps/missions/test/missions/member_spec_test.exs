defmodule Swarm.MemberSpecTest do
  use ExUnit.Case, async: true
  alias Robot.File.Schema
  alias Swarm.{Comms, Formation, MemberSpec}
  alias Mesh.Options
  alias Missions.Landmark

  @robots Path.expand("../../../../config/robots", __DIR__)

  defp parse(more) do
    drive = ~s(drive: {Hal.RFlex.Driver, port: "/dev/ttyS1"})
    text = "[id: :mag1, profile: :magellan, #{drive},\n#{more}]"
    Robot.File.parse(text, file: "mag1.exs", tables: MemberSpec.tables())
  end

  defp lines(more) do
    assert {:error, lines} = parse(more)
    lines
  end

  test "the robots of config are members of a fleet" do
    for id <- [:mag1, :min1] do
      {:ok, file} = MemberSpec.load(Path.join(@robots, "#{id}.exs"))
      assert {:ok, config} = MemberSpec.config(file)
      assert config.id == id
      assert config.arm == :manual
      assert config.mission == {Landmark, formation: {:column, 1.0}}
      assert List.keymember?(config.companions, Comms, 0)
      assert config.transport == {Swarm.Transport, :transmit, []}
      assert MemberSpec.mesh(file) == []
    end
  end

  test "the mission accepts all that the policies of a file may say" do
    for kind <- Formation.kinds(), spacing <- [0.8, 5.0] do
      assert {:ok, file} =
               parse("policies: [mission: :landmark, formation: {#{inspect(kind)}, #{spacing}}]")

      assert {:ok, %{mission: {Landmark, options}}} = MemberSpec.config(file)
      assert {^kind, ^spacing} = options[:formation]
      assert {:ok, _formation} = Formation.new(kind, spacing: spacing)
    end

    for {kind, spacing} <- [column: 0.79, column: 5.01] do
      assert {:error, _line} = Formation.new(kind, spacing: spacing)
      assert {:error, [_line]} = parse("policies: [formation: {#{inspect(kind)}, #{spacing}}]")
    end

    for link <- [:stop, :hold, :continue] do
      assert {:ok, file} =
               parse(
                 "policies: [mission: :landmark, policy: :majority, of: 6, lost_link: #{inspect(link)}]"
               )

      assert {:ok, %{mission: {Landmark, options}}} = MemberSpec.config(file)
      assert Landmark.Policy.of(options) == {6, link}
    end

    assert {:ok, file} = parse("policies: [formation: {:wedge, 1.0}]")
    assert {:ok, %{mission: nil}} = MemberSpec.config(file)

    for none <- ["", "mission: nil"] do
      assert {:ok, %{policies: policies} = file} = parse("policies: [#{none}]")
      assert policies[:mission] == nil
      assert {:ok, %{mission: nil}} = MemberSpec.config(file)
    end
  end

  test "errors in policies and network have line, key, what is allowed and a suggestion" do
    text = """
    policies: [mission: :landmark, formation: {:colum, 1.0},
      of: 0, leader_chagne: true],
    network: [port: -1, zzz: 1,
      peers: ["10.0.0.7"], multicast: {"239.255.67.86", 0}]
    """

    assert lines(text) == [
             "mag1.exs:2: policies.formation: expected :column, :line, :wedge, :triangle, :diamond or :circle, got :colum; did you mean :column?",
             "mag1.exs:3: policies.leader_chagne: is not known: allowed are mission, formation, formations, assign, leader_change, colour, policy, of, lost_link; did you mean leader_change?",
             "mag1.exs:3: policies.of: expected a whole number from 1 to 1000 robots of the fleet, got 0",
             "mag1.exs:4: network.zzz: is not known: allowed are fleet, secret_file, interface, port, multicast, peers, addresses, dist_port, allow, full_mesh, degree",
             "mag1.exs:4: network.port: expected a whole number from 0 to 65535, got -1",
             "mag1.exs:5: network.multicast: expected a whole number from 1 to 65535, got 0",
             "mag1.exs:5: network.peers.1: expected address and port, such as \"10.0.0.7:4370\", got \"10.0.0.7\""
           ]

    assert lines("policies: [mission: :landmrk, formation: 3]") == [
             "mag1.exs:2: policies.mission: expected nil, :landmark, :patrol, :flock, :explore, :chase, :push or :teleop, got :landmrk; did you mean :landmark?"
           ]

    assert [line] = lines("policies: [policy: :majority]")
    assert line =~ "mag1.exs:2: policies: landmark option of is missing: policy :majority needs"

    for more <- ["policies: 5", "policies: [5]", "policies: [{:assign, :luck}]", "network: [5]"] do
      assert ["mag1.exs:2: " <> _] = lines(more)
    end
  end

  test "the network and policies of a file reach mesh and mission" do
    assert {:ok, robot} =
             parse("""
             network: [secret_file: "/etc/convoy/secret", interface: "10.0.0.7",
               peers: ["10.0.0.8:4370"], multicast: {"239.255.67.86", 4371}],
             policies: [mission: :landmark, formation: {:wedge, 1}, policy: :majority, of: 6,
               lost_link: :hold, colour: "YellowLandmark"]
             """)

    assert robot.network[:interface] == {10, 0, 0, 7}
    assert robot.network[:multicast] == {{239, 255, 67, 86}, 4371}
    assert robot.network[:peers] == ["10.0.0.8:4370"]
    assert robot.policies[:formation] == {:wedge, 1.0}
    assert {:ok, %{mission: {Landmark, options}}} = MemberSpec.config(robot)
    assert options[:of] == 6 and options[:colour] == "YellowLandmark"
  end

  test "the mesh accepts all that the network of a file may say" do
    secret = Path.join(System.tmp_dir!(), "start_#{System.unique_integer([:positive])}")
    {:ok, _secret} = Mesh.Secret.create(secret, false)
    on_exit(fn -> File.rm(secret) end)

    for more <- [
          ~s(interface: "127.0.0.1", port: 0, dist_port: 9101),
          ~s(multicast: {"239.255.67.86", 4371}),
          ~s(multicast: false, peers: ["10.0.0.7:4370"], full_mesh: 2, degree: 8),
          ~s(addresses: ["203.0.113.5:4370"]),
          ~s(multicast: false, full_mesh: 1000, degree: 2, port: 65535)
        ] do
      assert {:ok, file} = parse(~s(network: [secret_file: "#{secret}", #{more}]))
      assert {:ok, %Options{}} = Options.new(MemberSpec.mesh(file))
    end
  end

  test "a fleet of other names is listed in the file, with the robot's own" do
    assert {:ok, file} = parse(~s(network: [fleet: ["mag1", "rover_of_the_lab"]]))
    assert [:mag1, rover] = MemberSpec.mesh(file)[:fleet]
    assert Atom.to_string(rover) == "rover_of_the_lab"
    assert {:ok, _config} = MemberSpec.config(file)

    assert {:ok, file} = parse(~s(network: [fleet: ["rover_of_the_lab"]]))

    assert MemberSpec.config(file) ==
             {:error,
              "network.fleet: expected all robots of the fleet, with mag1, whose file it is"}

    assert {:error, [line]} = parse(~s(network: [fleet: ["Rover"]]))

    assert line =~
             ~s(network.fleet.1: expected a robot's name such as "mag1" or "rover_2", got "Rover")
  end

  test "template and guide describe every key" do
    template = File.read!(Path.join(@robots, "template.exs"))
    guide = File.read!(Path.expand("../../../../docs/robots.md", __DIR__))

    context = %{
      bodies: nil,
      bodiless?: true,
      colours: nil,
      map: nil,
      tables: MemberSpec.tables()
    }

    missions = [:mission | Keyword.keys(Landmark.option_table())]

    for key <- all_keys(Schema.table(context)) ++ missions do
      assert template =~ ~r/\b#{key}:\s/, "template.exs does not tell of #{key}:"
      assert guide =~ ~r/`#{key}:[` ]/, "robots.md does not tell of #{key}:"
    end
  end

  # A comment with a key is an example, which must be valid when it is no longer a comment.
  test "the examples in the template are valid" do
    text = File.read!(Path.join(@robots, "template.exs"))

    examples =
      for [line, indent, example] <- Regex.scan(~r/^( +)# (\w+: .*)$/m, text),
          # Neither with something left out, nor the beginning of a longer list.
          not String.contains?(line, "…") and not (line =~ ~r/\[( +#.*)?$/),
          do:
            {line,
             indent <>
               (example |> String.replace(~r/ +#.*$/, "") |> String.trim_trailing(",")) <> ","}

    assert length(examples) > 25
    {:ok, colours} = Vision.Colours.read(Path.join(@robots, "landmark.txt"))
    read = fn "landmark.txt", _options -> {:ok, colours} end
    grid = Nav.Grid.new(<<0>>, {1, 1}, 1.0, {-0.5, -0.5})
    map = fn file -> {:ok, %Nav.MapFile{file: file, grid: grid}} end

    for {line, example} <- examples do
      changed = String.replace(text, line, example)
      options = [colours: read, map: map, tables: MemberSpec.tables()]
      assert {:ok, _robot} = Robot.File.parse(changed, options), example
    end
  end

  defp all_keys({:keys, table}),
    do: Enum.flat_map(table, fn {key, check} -> [key | all_keys(check)] end)

  defp all_keys({:or, _value, check}), do: all_keys(check)
  defp all_keys({:list, check, _most}), do: all_keys(check)
  defp all_keys([check | _settings]), do: all_keys(check)
  defp all_keys(_check), do: []
end
