[
  about: "A robot that is frozen while it drives stands, and goes on to its place afterwards.",
  robots: 6,
  duration_s: 100,
  script: [
    {12, {:freeze, :mag1, 8}}
  ],
  expect: [
    {:still, :mag1, from_s: 14, to_s: 20},
    {:moves, :mag1, by_s: 60, after_s: 20},
    {:formed, by_s: 90, after_s: 20},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
