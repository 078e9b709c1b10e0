[
  about:
    "Without leader changes, the leader leads on when the landmark moves, however well others see it.",
  robots: 4,
  duration_s: 110,
  leader_change: false,
  script: [
    {35, {:move, {-3, 2}}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:same_leader, from_s: 34},
    {:formed_again, after_s: 36, within_s: 60},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
