[
  about:
    "Experiment 1: a robot drives to places that it is told, turns on the spot where they lie aside, and ends on each within 10 cm. In the thesis: sections 3.3.1 and 5.3.4, in simulation and on real robots.",
  robots: 1,
  landmark: :none,
  duration_s: 110,
  script: [
    {0, {:tell, :mag1, "goto:1:1"}},
    {30, {:tell, :mag1, "goto:-1:1"}},
    {50, {:tell, :mag1, "goto:-1:-1"}},
    {70, {:tell, :mag1, "goto:1:-1"}},
    {90, {:tell, :mag1, "goto:1:1"}}
  ],
  expect: [
    {:at, :mag1, {1, 1}, within_m: 0.2, by_s: 30},
    {:at, :mag1, {-1, 1}, within_m: 0.2, by_s: 50, after_s: 30},
    {:at, :mag1, {-1, -1}, within_m: 0.2, by_s: 70, after_s: 50},
    {:at, :mag1, {1, -1}, within_m: 0.2, by_s: 90, after_s: 70},
    {:at, :mag1, {1, 1}, within_m: 0.2, by_s: 110, after_s: 90},
    {:speed_at_most, 0.6}
  ]
]
