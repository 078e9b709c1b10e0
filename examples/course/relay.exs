[
  about:
    "Exercise 4: in the mission `relay` one robot drives after the other, though a third of all messages is lost.",
  robots: [:mag1, :mag2, :min1],
  seed: 4,
  landmark: :none,
  mission: :relay,
  loss: 0.33,
  duration_s: 240,
  expect: [
    {:still, :mag2, from_s: 0.5, to_s: 5},
    {:still, :min1, from_s: 0.5, to_s: 10},
    {:at, :mag1, {-2, 3}, within_m: 0.3, by_s: 70},
    {:at, :mag2, {0, 3}, within_m: 0.3, by_s: 140},
    {:at, :min1, {2, 3}, within_m: 0.3, by_s: 210},
    {:formed, by_s: 230},
    {:never, :collision}
  ]
]
