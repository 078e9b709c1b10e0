import Config

# By name; the first is that of a robot whose file names none.
config :swarm,
  missions: [gather: Gather, landmark: Missions.Landmark, patrol: Missions.Patrol],
  recorder: Record.Recorder
