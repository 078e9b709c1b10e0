defmodule Swarm.MemberSpecTest do
  use ExUnit.Case, async: true
  alias Robot.File.Schema
  alias Swarm.{Comms, Formation, MemberSpec}
  alias Mesh.Options
  alias Mesh.Protocol.Roster
  alias Missions.Landmark

  @robots Path.expand("../../../../config/robots", __DIR__)

  defp parse(more) do
    drive = ~s(drive: {Hal.RFlex.Driver, port: "/dev/ttyS1"})
    Robot.File.parse("[id: :mag1, profile: :magellan, #{drive}, #{more}]")
  end

  test "the robots that come along are members of a fleet" do
    for id <- [:mag1, :min1] do
      {:ok, file} = Robot.File.load(Path.join(@robots, "#{id}.exs"))
      assert {:ok, config} = MemberSpec.config(file)
      assert config.id == id
      assert config.arm == :manual
      assert config.mission == {Landmark, formation: {:column, 1.0}}
      assert {Comms, _options} = List.last(config.companions)
      assert config.send == {Comms, :say, [id]}
      assert MemberSpec.mesh(file) == []
    end
  end

  test "all that a file's policies may say, the mission takes" do
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
  end

  test "all that a file's network may say, the mesh takes" do
    secret = Path.join(System.tmp_dir!(), "start_#{System.unique_integer([:positive])}")
    {:ok, _secret} = Mesh.Secret.create(secret, false)
    on_exit(fn -> File.rm(secret) end)

    for more <- [
          ~s(interface: "127.0.0.1", port: 0, dist_port: 9101),
          ~s(multicast: {"239.255.67.86", 4371}),
          ~s(multicast: false, peers: ["10.0.0.7:4370"], full_mesh: 2, degree: 8),
          ~s(multicast: false, full_mesh: 1000, degree: 2, port: 65535)
        ] do
      assert {:ok, file} = parse(~s(network: [secret_file: "#{secret}", #{more}]))
      assert {:ok, %Options{}} = Options.new(MemberSpec.mesh(file))
    end
  end

  test "a file knows the same robots as the mesh" do
    assert Schema.fleet() == Roster.fleet()
  end
end
