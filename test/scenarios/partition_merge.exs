[
  about:
    "The radio is cut in two and whole again: each part has a leader of its own meanwhile, then one leads all, in formation.",
  robots: 6,
  duration_s: 150,
  script: [
    {35, {:cut, [[:mag1, :mag2, :mag3], [:min1, :min2, :min3]]}},
    {60, {:join}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:one_leader, after_s: 50, to_s: 60},
    {:one_leader, after_s: 75, to_s: 85},
    {:agreed, by_s: 80, after_s: 61},
    {:formed_again, after_s: 60, within_s: 70},
    {:never, :collision}
  ]
]
