[
  about:
    "Requirement 11.1: a robot told to go to the corners of a square of 2 m stands on each, within 10 cm, without noise.",
  robots: 1,
  landmark: :none,
  noise: :off,
  duration_s: 110,
  script: [
    {0, {:tell, :mag1, "goto:1:1"}},
    {30, {:tell, :mag1, "goto:-1:1"}},
    {50, {:tell, :mag1, "goto:-1:-1"}},
    {70, {:tell, :mag1, "goto:1:-1"}},
    {90, {:tell, :mag1, "goto:1:1"}}
  ],
  expect: [
    {:at, :mag1, {1, 1}, within_m: 0.1, by_s: 30},
    {:at, :mag1, {-1, 1}, within_m: 0.1, by_s: 50, after_s: 30},
    {:at, :mag1, {-1, -1}, within_m: 0.1, by_s: 70, after_s: 50},
    {:at, :mag1, {1, -1}, within_m: 0.1, by_s: 90, after_s: 70},
    {:at, :mag1, {1, 1}, within_m: 0.1, by_s: 110, after_s: 90},
    {:phase, :mag1, :done, by_s: 110, after_s: 95}
  ]
]
