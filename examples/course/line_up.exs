[
  about:
    "Exercise 2: the mission `line_up` has all robots stand in a row, by their names, 1 m apart.",
  robots: [:mag1, :mag2, :min1, :min2],
  seed: 2,
  landmark: :none,
  mission: :line_up,
  duration_s: 120,
  expect: [
    {:at, :mag1, {-1.5, 0}, within_m: 0.3, by_s: 100},
    {:at, :mag2, {-0.5, 0}, within_m: 0.3, by_s: 100},
    {:at, :min1, {0.5, 0}, within_m: 0.3, by_s: 100},
    {:at, :min2, {1.5, 0}, within_m: 0.3, by_s: 100},
    {:formed, by_s: 110},
    {:never, :collision}
  ]
]
