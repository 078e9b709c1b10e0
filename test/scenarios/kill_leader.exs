[
  about: "The leader dies; the others elect another one and form again.",
  robots: 6,
  script: [
    {35, {:kill, :leader}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:leader_changed, after_s: 35, within_s: 15},
    {:formed_again, after_s: 35, within_s: 40},
    {:one_leader, after_s: 50, to_s: 60},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
