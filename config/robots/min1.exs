# min1, an ATRV mini. template.exs explains all keys.
[
  id: :min1,
  profile: :atrv_mini,
  # It has neither infrared nor bumpers.
  body: [bumpers: 0],
  drive:
    {Hal.RFlex.Driver,
     [
       port: "/dev/ttyS1",
       # The first bank looks to the left, the second to the right.
       sonar_banks: [8, 8],
       # distance and angle are missing until mix calibrate odometry has found them for this very
       # robot; it does not arm without.
       conversions: [range: 1476.0]
     ]},
  ptz: {Hal.Visca.Driver, port: "/dev/ttyS2"},
  camera: {Hal.Camera.FFmpeg, source: "/dev/video0", size: {320, 240}},
  colours: [file: "landmark.txt", distance: %{"YellowLandmark" => 0.0651}],
  limits: [max_linear: 0.3, max_turn: 0.5],
  start: {0.0, 0.0, deg(0)},
  estop_file: "/var/lib/convoy/estop",
  policies: [mission: :landmark, formation: {:column, 1.0}]
]
