[
  about: "A robot hears nobody for 10 s; it is back in its place later.",
  robots: 6,
  duration_s: 120,
  script: [
    {35, {:deaf, :mag1, 10}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:formed_again, after_s: 46, within_s: 60},
    {:agreed, by_s: 70, after_s: 45},
    {:never, :collision}
  ]
]
