Code.require_file("../../../test/start.exs", __DIR__)
# The missions that people start are in apps above this one.
Application.put_env(:swarm, :missions, landmark: Swarm.StandMission)
