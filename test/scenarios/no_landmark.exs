[
  about:
    "There is no landmark. Robots look for it three times, then they rest, and nobody claims anything.",
  robots: 3,
  landmark: :none,
  duration_s: 120,
  expect: [
    {:rest, by_s: 115},
    {:not_formed},
    {:never_phase, :all, :lead},
    {:never, :collision}
  ]
]
