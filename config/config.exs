import Config

# The Logger's console settings changed their names in Elixir 1.15.
if Version.match?(System.version(), ">= 1.15.0") do
  config :logger, :default_formatter,
    format: "$time [$level] $metadata$message\n",
    metadata: [:robot]
else
  config :logger, :console, format: "$time [$level] $metadata$message\n", metadata: [:robot]
end

config :logger, level: if(config_env() == :test, do: :warning, else: :info)

# The missions by name; the first is that of a robot whose file names none.
config :swarm,
  missions: [
    landmark: Missions.Landmark,
    patrol: Missions.Patrol,
    flock: Missions.Flock,
    explore: Missions.Explore,
    chase: Missions.Chase,
    push: Missions.Push,
    teleop: Missions.Teleop
  ]

# What records a robot whose file says `record:`, and keeps its last minute, if it says `incidents:`.
config :swarm, recorder: Record.Recorder, incidents: Record.Incidents

# What runs beside each robot: the programs of this build, which people start and end on it.
config :swarm, companions: [{Agents.Programs, battery: Agents.Battery}]

# What bin/demo and bin/console serve to other programs if they are asked to: option, port and module.
config :console,
  services: [
    foxglove: {8765, Bridge.Foxglove},
    rosbridge: {9090, Bridge.Rosbridge},
    rmf: {22_011, Bridge.Rmf}
  ]

# What a build adds of its own (docs/extending.md).
if File.exists?(Path.join(__DIR__, "extensions.exs")), do: import_config("extensions.exs")
