defmodule Console.Prompt.Help do
  @moduledoc false
  # The help of `Console.Prompt`, as it is read in a terminal.
  alias Swarm.MissionRegistry

  @doc "The help, one command a line; of what only some fleets can do, what this one offers."
  @spec lines([Console.Live.offer()]) :: [String.t()]
  def lines(offers) do
    when_offered = fn offer, lines -> if offer in offers, do: lines, else: [] end

    when_offered.(:kill, ["kill leader, kill mag2        that robot dies"]) ++
      [
        "formation wedge 1.2           column, line, wedge, triangle, diamond or",
        "                              circle, and a spacing of 0.8 to 5 m"
      ] ++
      when_offered.(:landmark, [
        "landmark 3,2, landmark none   the landmark glides there, or is removed"
      ]) ++
      when_offered.(:place, [
        "place mag2 1,2, place ball1 2,0   a robot, a ball or a box is put there"
      ]) ++
      [
        "goto mag2 1,2                 one robot drives to a place",
        "follow min1 mag2              one robot follows another",
        "drive mag2                    drives it by the keys of this terminal",
        "gamepad mag2, gamepad off     drives it by /dev/input/js0, or by another path",
        "stop, stop mag2               the fleet or one robot stops and stands",
        "start, start mag2             starts the mission again, from the search",
        "start patrol:period=90        starts another mission:"
      ] ++
      for names <- Enum.chunk_every(MissionRegistry.names(), 5) do
        "                              " <> Enum.join(names, ", ")
      end ++
      [
        "replace flock                 they stand, change the mission, and go on;",
        "replace mag2 patrol           what ends in 10 s goes back (not in lockstep)",
        "mag2 wander, rest, square:2   one robot roams, rests, drives a square",
        "run mag2 NAME                 one robot runs a behaviour of your own",
        "program mag2 start battery    starts a program on a robot, or ends it",
        "send mag2 leg:leg=3           a message to its mission; send all … to each",
        "estop, or F8; reset           emergency stop of all, until the reset",
        "keep, keep mag2               their last minute is written as a recording",
        "mag2 move:0.2:0.1, all stop   any text command to one robot, or to all"
      ] ++
      when_offered.(:arm, [
        "arm mag2, disarm mag2         lets its wheels turn, or keeps them still; or all",
        "acknowledge mag2              somebody has checked why its line was lost"
      ]) ++
      when_offered.(:kill, [
        "pause, resume                 the run stops, and goes on (with --speed)",
        "step, step 10                 so many steps of 0.1 s while it is paused",
        "speed 0.5, speed max          0.1 to 100 times real time, or its fastest"
      ]) ++
      [
        "status, status mag2           what all robots do",
        "nodes                         the processes, and how to attach to one",
        "page                          the address of the page for your browser",
        "quit                          ends the demo, as Ctrl-C does; Tab completes"
      ]
  end
end
