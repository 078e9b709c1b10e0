# A robot on the desk: it drives in its mind only.
[
  id: :mag1,
  profile: :magellan,
  body: [radius: 0.2, length: 0.4, width: 0.4, wheel_base: 0.3, sonars: [], irs: [], bumpers: 0],
  drive: {Gather.DeskBase, period: 100},
  policies: [mission: {:gather, radius: 1.0}]
]
