[
  about: "All robots were switched on at one pose and then driven to their own by hand.",
  robots: 6,
  seed: 15,
  start: :same,
  duration_s: 110,
  expect: [
    {:formed, by_s: 100},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
