# TurtleBot3 Waffle Pi.
# Sources: ROBOTIS e-Manual, TurtleBot3, Specifications (size, mass, greatest speeds); turtlebot3_node/param/waffle_pi.yaml
# (wheel separation); turtlebot3_waffle_pi.urdf (the body about the wheels' axle, the camera's height); the Raspberry Pi's
# camera module 2 (field of view); LDS-01's sheet (ranges, turns), the same urdf (its place).
[
  about: "a TurtleBot3 Waffle Pi",
  board: :turtlebot3_waffle,
  mass: 1.8,
  length: 0.281,
  width: 0.306,
  offset: -0.064,
  height: 0.141,
  wheel_base: 0.287,
  limits: [max_linear: 0.26, max_turn: 1.82],
  # An LDS-01: five turns a second.
  scan: [
    pose: {-0.064, 0.0, 0.0},
    rays: 360,
    min: 0.12,
    max: 3.5,
    period: 0.2,
    model: :lds01
  ],
  # It is fixed, and looks ahead.
  camera: [
    width: 320,
    height: 240,
    field_of_view: deg(62.2),
    mount_height: 0.102,
    max_pan: 0.0,
    max_tilt: 0.0
  ]
]
