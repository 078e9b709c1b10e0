[
  about:
    "Requirement 11.7: the leader goes 1 m on, because the landmark does; the last robot of the column is under way within seconds.",
  robots: 4,
  duration_s: 90,
  script: [
    {40, {:move, {-0.7, -0.7}}}
  ],
  expect: [
    {:formed, by_s: 40},
    {:moves, :mag2, by_s: 45, after_s: 41},
    {:in_slot, :all, within_m: 0.3, by_s: 70, after_s: 46},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
