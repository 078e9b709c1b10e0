[
  about:
    "Requirement 11.8: a command of 9 m/s drives the robot at the speed of its body, and no faster; a stop ends it.",
  robots: 1,
  landmark: :none,
  noise: :off,
  duration_s: 20,
  script: [
    {0, {:displace, :mag1, {-6, 0, 0}}},
    {1, {:tell, :mag1, "move:9:0"}},
    {5, {:tell, :mag1, :stop}}
  ],
  expect: [
    {:moves, :mag1, by_s: 3},
    {:speed_at_most, 0.5},
    {:still, :mag1, from_s: 8, to_s: 12},
    {:never, :collision}
  ]
]
