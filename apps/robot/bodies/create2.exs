# iRobot Create 2, and Roombas of the 600 series.
# Sources: iRobot Create 2 Open Interface Specification (greatest speed of a wheel, bumpers: left and right in front);
# libcreate's data.cpp (wheel base); iRobot's data sheet (size, mass). The greatest turn is that of both wheels at 0.5 m/s.
[
  about: "an iRobot Create 2",
  board: :create,
  mass: 3.6,
  radius: 0.17,
  height: 0.092,
  wheel_base: 0.235,
  limits: [max_linear: 0.5, max_turn: 4.25],
  bumpers: 16,
  bumper_span: deg(180)
]
