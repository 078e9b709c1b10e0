# mag1, a Magellan Pro. template.exs explains all keys.
[
  id: :mag1,
  profile: :magellan,
  drive:
    {Hal.RFlex.Driver,
     [
       port: "/dev/ttyUSB0",
       # Two boards of 8; the bumpers are bits of two addresses.
       sonar_banks: [8, 8],
       bumpers: [style: :bit, base: 0x40, count: 16],
       # distance and angle are missing until mix calibrate odometry has found them for this very
       # robot; it does not arm without. Without ir_a and ir_b its infrareds are not read.
       conversions: [range: 1474.0]
     ]},
  ptz: {Hal.Visca.Driver, port: "/dev/ttyS2"},
  camera: {Hal.Camera.FFmpeg, source: "/dev/video0", size: {320, 240}},
  colours: [file: "landmark.txt", distance: %{"YellowLandmark" => 0.0651}],
  limits: [max_linear: 0.3],
  start: {0.0, 0.0, deg(0)},
  estop_file: "/var/lib/convoy/estop",
  policies: [mission: :landmark, formation: {:column, 1.0}]
]
