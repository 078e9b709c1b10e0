# TurtleBot3 Burger, with the camera of ROBOTIS' model burger_cam.
# Sources: ROBOTIS e-Manual, TurtleBot3, Specifications (size, mass, greatest speeds); turtlebot3_node/param/burger.yaml
# (wheel separation); turtlebot3_burger_cam.urdf of turtlebot3_simulations (the body about the wheels' axle, the camera's
# height); the Raspberry Pi's camera module 2 (field of view); LDS-01's sheet (ranges, turns), the same urdf (its place).
[
  about: "a TurtleBot3 Burger",
  board: :turtlebot3_burger,
  mass: 1.0,
  length: 0.138,
  width: 0.178,
  offset: -0.032,
  height: 0.192,
  wheel_base: 0.160,
  limits: [max_linear: 0.22, max_turn: 2.84],
  # An LDS-01: five turns a second.
  scan: [
    pose: {-0.032, 0.0, 0.0},
    rays: 360,
    min: 0.12,
    max: 3.5,
    period: 0.2,
    model: :lds01
  ],
  # It is fixed, and looks ahead. body: [camera: nil] for one without.
  camera: [
    width: 320,
    height: 240,
    field_of_view: deg(62.2),
    mount_height: 0.129,
    max_pan: 0.0,
    max_tilt: 0.0
  ]
]
