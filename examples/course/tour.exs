[
  about: "Exercise 1: the behaviour `tour` takes a robot to four places, one after the other.",
  robots: [:mag1],
  seed: 1,
  landmark: :none,
  duration_s: 200,
  script: [{1, {:tell, :mag1, "run:tour"}}],
  expect: [
    {:at, :mag1, {3, 3}, within_m: 0.3, by_s: 60},
    {:at, :mag1, {-3, 3}, within_m: 0.3, after_s: 15, by_s: 100},
    {:at, :mag1, {-3, -3}, within_m: 0.3, after_s: 30, by_s: 140},
    {:at, :mag1, {3, -3}, within_m: 0.3, after_s: 45, by_s: 180},
    {:phase, :mag1, :done, by_s: 190}
  ]
]
