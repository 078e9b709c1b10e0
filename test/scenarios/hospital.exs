[
  about: "In the room of a hospital; the leader dies there.",
  robots: 4,
  seed: 2,
  map: "hospital",
  duration_s: 150,
  script: [
    {50, {:kill, :leader}}
  ],
  expect: [
    {:formed, by_s: 50},
    {:formed_again, after_s: 50, within_s: 90},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
