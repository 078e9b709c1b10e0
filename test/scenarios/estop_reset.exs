[
  about:
    "The emergency stop of one robot stops all. A reset moves nobody; a start does, and the fleet forms.",
  robots: 6,
  duration_s: 120,
  script: [
    {15, {:estop, :mag2}},
    {25, {:reset}},
    {32, {:tell, :all, :start}}
  ],
  expect: [
    {:moves, :mag1, by_s: 15},
    {:still, :all, from_s: 18, to_s: 32},
    {:phase, :all, :idle, by_s: 18, after_s: 16},
    {:formed, by_s: 100, after_s: 32},
    {:never, :collision}
  ]
]
