[
  about:
    "Three of six robots die one after the other, two of them leaders; three are left, in formation.",
  robots: 6,
  seed: 5,
  duration_s: 120,
  script: [
    {10, {:kill, :leader}},
    {40, {:kill, :leader}},
    {41, {:kill, :mag2}}
  ],
  expect: [
    {:leader, by_s: 10},
    {:formed_again, after_s: 41, within_s: 60},
    {:agreed, by_s: 100, after_s: 42},
    {:never, :collision}
  ]
]
