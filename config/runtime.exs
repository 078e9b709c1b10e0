import Config

# The settings of a robot, from its environment; `rel/env.sh.eex` lists and checks them. Outside of
# a release `bin/node` sets them, and else nothing of this applies.
robot = System.get_env("RELEASE_NAME") && System.get_env("ROBOT")

if name = robot || System.get_env("CONVOY_NODE") do
  number = fn name, default ->
    case Integer.parse(System.get_env(name, "")) do
      {number, ""} -> number
      _other -> default
    end
  end

  words = fn name -> name |> System.get_env("") |> String.split([",", " "], trim: true) end

  interface = for text <- words.("CONVOY_INTERFACE"), do: {:interface, text}

  # All names that robots may have: of this machine's own configuration, never from others.
  fleet = with [_ | _] = names <- words.("CONVOY_FLEET"), do: [fleet: names]

  dist_port = number.("CONVOY_DIST_PORT", Mesh.Distribution.Epmd.default_port(name))

  # In a release the node is the robot of its file (`Swarm.Host.ReleaseBoot`).
  config :swarm,
    boot: robot != nil,
    mesh:
      [
        secret_file: System.get_env("CONVOY_SECRET_FILE", "/etc/convoy/secret"),
        dist_port: dist_port,
        port: number.("CONVOY_UDP_PORT", if(robot, do: 4370, else: 0)),
        peers: words.("CONVOY_UDP_PEERS")
      ] ++ fleet ++ interface
end
