[
  about:
    "Requirement 11.2: a robot told to find the landmark, which stands behind it, turns and finds it.",
  robots: 1,
  duration_s: 30,
  script: [
    {0, {:displace, :mag1, {3, 0, 0}}},
    {0, {:tell, :mag1, "findblob"}}
  ],
  expect: [
    {:phase, :mag1, :found, by_s: 20},
    {:at, :mag1, {3, 0}, within_m: 0.1, by_s: 25, after_s: 20}
  ]
]
