[
  about:
    "Requirement 11.9, as far as a lockstep has it: a robot in the middle of the column dies, its leader leads on, the others close up.",
  robots: 6,
  duration_s: 90,
  script: [
    {35, {:kill, :mag1}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:same_leader, from_s: 34},
    {:formed_again, after_s: 35, within_s: 40},
    {:never, :bad_anchor},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
