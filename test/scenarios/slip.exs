[
  about: "Wheels that slip on every turn: what the leader claims is true all the same.",
  robots: 6,
  seed: 4,
  noise: :slip,
  duration_s: 120,
  expect: [
    {:formed, by_s: 110},
    {:never, :false_claim},
    {:never, :stuck},
    {:never, :collision}
  ]
]
