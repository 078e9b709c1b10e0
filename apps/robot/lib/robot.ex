defmodule Robot do
  @moduledoc """
  Runs one robot: what it perceives, wishes and may do, ten times a second.

  A tick is a function (`Robot.Control.Controller`): from a percept (`Robot.Percept`) behaviours make wishes
  (`Robot.Behaviour`), the arbiter chooses one, and the gate limits it (`Robot.Safety.Reflex`). What a robot does over
  minutes is a mission (`Robot.Mission`).

  Of two wishes the heavier one wins, and the one that won last counts a tenth more:

      iex> wishes = for {by, weight} <- [rest: 0.05, goto: 0.5], do: Robot.Wish.new(by, Hal.Twist.new(0.2, 0), weight)
      iex> Robot.Behaviour.Arbiter.choose(wishes, nil).by
      :goto

  A person's text is a command, or one line that says what is allowed:

      iex> Robot.Command.parse("goto:2:1", [:mag1])
      {:ok, {:goto, 2.0, 1.0, nil}}

  The processes of one robot; a crash of one does not restart those above it:

      Robot.Supervisor (rest_for_one)
      |-- Robot.Board             the newest readings, in ETS
      |-- Robot.Devices           Vision.BlobDetector, Hal.Device for each line
      |-- Robot.Safety.Gate       reflexes, limits, dead man's switch; alone drives the wheels
      |-- Robot.Control.Executive the tick
      `-- Robot.Control.Pilot     the mission

  Go on with `Robot.Behaviour` and `Robot.Mission`, which are yours to write (`docs/missions.md`, `docs/extending.md`), and with
  `docs/architecture.md`.
  """
end
