# Kobuki, the base of the TurtleBot 2, without the lidar or camera that others mount on it.
# Sources: kobuki_documentation, specifications.rst and conversions.rst (greatest speeds, wheel base); Yujin's data sheet
# (size, mass); kobuki_core's diff_drive.cpp (accelerations, beyond which it lifts its front).
[
  about: "a Kobuki",
  board: :kobuki,
  mass: 2.35,
  radius: 0.176,
  height: 0.125,
  wheel_base: 0.230,
  limits: [
    max_linear: 0.7,
    max_turn: deg(180),
    max_acceleration: 0.3,
    max_turn_acceleration: 3.5
  ],
  # Left, centre and right, over the front half.
  bumpers: 16,
  bumper_span: deg(180)
]
