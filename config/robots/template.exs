# One robot. Copy this file to config/robots/NAME.exs, change it, and look at what comes of it:
#
#     mix robot.check config/robots/NAME.exs
#
# The file is read, never run. It holds numbers, "text", :names, [lists], {tuples}, and deg(…), which
# is degrees in radians. Metres, radians, seconds; x is forward, y is left, angles grow to the left.
# What is commented out is the default, or an example where there is none.
[
  # Its name: a letter, then letters, digits and _, at most 31, all small. mag1 to mag100 and min1 to min100 are known to all
  # robots; of others network: has the fleet:.
  id: :mag1,

  # Its body: :magellan, :atrv_mini, :turtlebot3_burger, :turtlebot3_waffle, :create2, :kobuki, :pioneer3, or one of your own,
  # :rover for config/bodies/rover.exs, which has the keys of body: below. Geometry, sensor poses and limits come with it.
  profile: :magellan,

  # What is different on this one, or all of a body without a profile:. All lengths in metres.
  body: [
    # about: "a Magellan Pro",           # what people call it
    # mass: 20,                          # kg
    # board: :kobuki,                    # its controller; also create, turtlebot3_burger, turtlebot3_waffle, arduino
    # radius: 0.2,                       # of the circle round the whole body, about the middle between the wheels
    # length: 0.4,                       # a box has these two; a round body has a radius alone
    # width: 0.4,
    # offset: 0.0,                       # how far the middle of the box is ahead of the wheels
    # limits: [max_linear: 0.5, max_turn: 1.0], # what such a body can do; limits: below are this robot's
    # height: 0.5,
    # wheel_base: 0.36,                  # between the wheels, left to right
    # bumpers: 16,                       # so many round it, the first ahead; 0 for none
    # bumper_span: deg(360),             # 180 for a body that has those of its front half only
    # sonars: [{0.2, 0.0, deg(0)}, …],   # {x, y, angle} of each, in the order of the driver's readings
    # sonar_min: 0.15,
    # sonar_max: 5.1,
    # sonar_cone: deg(30),               # full width
    # scan: [                            # a lidar; nil for none
    #   pose: {0.0, 0.0, deg(0)}, rays: 360, field_of_view: deg(360), min: 0.15, max: 12.0, period: 0.1
    # ],
    # irs: [{0.2, 0.0, deg(0)}, …],
    # ir_max: 0.8,
    # camera: [                          # nil for none
    #   width: 320, height: 240, field_of_view: deg(60), mount_height: 0.6,
    #   max_pan: deg(100), max_tilt: deg(25), pan_rate: deg(80), tilt_rate: deg(50)
    # ]
  ],

  # Its wheels, with sonar, infrared, bumpers and battery: a driver and its options, which
  # the driver's own documentation lists.
  drive:
    {Hal.RFlex.Driver,
     [
       port: "/dev/ttyUSB0",
       # sonar_banks: [8, 8],              # how many sonars each board has; for infrareds ir_banks:
       # bumpers: [style: :bit, base: 0x40, count: 16],
       conversions: [
         # Without distance and angle it does not arm. They differ from robot to robot, by 7 % and more:
         # mix calibrate odometry finds them. Published ones, to begin with: Magellan Pro 31387
         # and 4654.2, ATRV mini 190000 and 60000.
         # distance: 31_387.0,             # units per metre
         # angle: 4654.2,                  # units per radian
         # wheel_ratio: 1.0,               # way of the right wheel for the left one's
         # ir_a: 4000.0, ir_b: -2.0,       # infrared: metres are a * V^b; one, or a list of each
         # units per metre of a sonar's range
         range: 1474.0
       ]
     ]},

  # The camera's head, a Sony EVI-D30, D31, D70 or D100: {Hal.Visca.Driver, port: "/dev/ttyS2"}, or nil for
  # a camera that looks ahead. With model: :d30 (:d70, :d100) any other is taken for that one.
  ptz: nil,

  # The camera: {Hal.Camera.FFmpeg, source: "/dev/video0", size: {320, 240}}, or nil for none. A frame
  # grabber is told norm: :pal (:ntsc, :secam) and input: 1, the number of the socket; any V4L2 device
  # rate: 10 and pixel_format: :mjpeg (:yuyv, :uyvy, …).
  camera: nil,

  # The lidar of a body that has one: {Hal.RPLidar.Driver, port: "/dev/ttyUSB1"}, or nil for none.
  scan: nil,

  # What the camera looks for: a CMVision colour file, searched beside this one. With more to say:
  # [file: "landmark.txt", distance: %{"YellowLandmark" => 0.0651}, min_area: 20, max_area: 0];
  # distance is the share of the picture that a thing fills which is 1 m away.
  colours: "landmark.txt",

  # The printed marks that the camera looks for (mix mark): [family: :tag36h11, size: 0.16], or nil for none; those of the
  # family :similar need no library. The size is the side of the square between the corners, in metres. Where some hang and
  # face that the map does not name, known: [{7, {2.0, 1.5, deg(90)}}] says, and robots: [{11, :mag2}]
  # says which robots bear them on their backs.
  marks: nil,

  # Keeps pictures of the camera as JPEG, so many a second, the newest of them, in a folder that is there:
  # [folder: "/var/lib/convoy/pictures", rate: 1.0, files: 1000, megabytes: 100], or nil for none.
  save_pictures: nil,

  # Lower than what its body can do, never higher.
  limits: [
    # max_turn: 1.0,                       # rad/s; an ATRV mini 0.8
    # max_acceleration: 0.5,               # m/s2, also of braking
    # max_turn_acceleration: 1.0,          # rad/s2
    # m/s; a Magellan and an ATRV mini can do 0.5
    max_linear: 0.3
  ],

  # Where it is switched on and started, in the map that all robots share.
  start: {0.0, 0.0, deg(0)},

  # The floor plan of its building, as map_server writes it: a description in YAML, searched beside this file, and the
  # PNG or PGM that it names. Then it drives round walls and through doors. nil for none.
  # map: "building.yaml",

  # :manual: its wheels stand until a person arms them. :auto: they turn as soon as they are told.
  # arm: :manual,

  # A line that it does not cross, by what its wheels say: two opposite corners of a rectangle, or a list of
  # corners of a polygon, in metres of the map. Give it where some of the fleet are simulated. nil for none.
  # fence: {{-2.0, -1.5}, {4.0, 1.5}},     # or [{0.0, 0.0}, {4.0, 0.0}, {2.0, 3.0}]

  # With true nothing moves, and what would be done is printed. For the first run of a robot.
  # dry_run: false,

  # With true its mission may be replaced while it is under way by whoever has the fleet's secret, with :code also by
  # code that its release does not have (docs/missions.md). A restart returns to the release.
  # replace: false,

  # Says aloud these stages of its mission, and "estop" and "reset", by Debian's espeak-ng; nil for nothing.
  # say: [events: ["elected", "formed", "estop"], program: "espeak-ng", voice: "en"],

  # It moves only while a person's page, gamepad or bin/presence is heard, and so many seconds after the last word it stops and
  # is held, as by an emergency stop. 0.5 to 60; nil for never.
  # presence: 1.0,

  # Here an e-stop outlives a restart of the machine; the folder must be there.
  # estop_file: "/var/lib/convoy/estop",

  # Records what it is told and does, for `mix replay` and Foxglove: numbered files in this folder, of which the
  # oldest are deleted before they exceed limit_mb, 4 or more. An hour on a mission takes about 40 MB. nil for none.
  # record: [folder: "/var/lib/convoy/runs", limit_mb: 500, pictures: 1],

  # Keeps its last minute in memory, and writes it after an emergency stop, a fault or a crash.
  # incidents: [folder: "/var/lib/convoy/incidents", limit_mb: 100, seconds: 60],

  # For `robot halt`, the last thing that this machine does: the controller reads the phrase on the machine's
  # serial console and cuts the power. Without it, or nil, there is no such command.
  # console: [port: "/dev/ttyS0", speed: 9600, phrase: "The system is halted"],

  # How it meets the others.
  network: [
    # fleet: ["mag1", "mag2"],             # the names of all robots; mag1 to mag100 and min1 to min100, unless given
    # secret_file: "/etc/convoy/secret",   # stands above CONVOY_SECRET_FILE; best left out
    # interface: "wlan0",                  # the network card, or the address as "10.0.0.11", to use; all, unless given
    # port: 4370,                          # UDP
    # multicast: {"239.255.67.86", 4371},  # false where it is blocked; then name some:
    # peers: ["10.0.0.12:4370"],
    # addresses: ["203.0.113.5:4370"],     # how others see it, where a router changes addresses
    # dist_port: 9101,                     # TCP
    # allow: ["10.0.0.20"],                # who may connect by TCP besides robots that it hears: addresses
    #                                      # and networks, such as a laptop that is not of the fleet
    # full_mesh: 30,                       # up to so many robots each is connected to each,
    # degree: 8                            # above that to so many
  ],

  # What it does with the others.
  policies: [
    # mission: :landmark,                  # nil: none until it is told one; or {:patrol, period: 90}
    # formation: {:column, 1.0},           # :column :line :wedge :triangle :diamond :circle; 0.8 to 5 m
    # formations: [{3, :line}],            # that which a mark with this number asks the leader for
    # assign: :chain,                      # or :cost
    # leader_change: true,
    # colour: "YellowLandmark",
    # policy: :available,                  # :majority: only more than half of the fleet has a leader
    # of: 6,                               # the number of robots of the fleet, for :majority
    # lost_link: :stop                     # without the others: :stop, :hold or :continue
  ]
]
