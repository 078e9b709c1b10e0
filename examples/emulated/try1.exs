# try1, a Magellan Pro that bin/emulate plays: docs/robots.md, "Without a robot".
[
  id: :try1,
  profile: :magellan,
  drive:
    {Hal.RFlex.Driver,
     port: "/tmp/base", conversions: [distance: 31_387.0, angle: 4654.2, range: 1474.0]},
  estop_file: "/tmp/try1.estop"
]
