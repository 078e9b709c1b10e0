[
  about:
    "The leader gets no processor for 8 s. Another one leads by then, and when it goes on it does not lead beside that one for long.",
  robots: 6,
  duration_s: 120,
  script: [
    {35, {:freeze, :leader, 8}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:leader_changed, after_s: 35, within_s: 8},
    {:agreed, by_s: 60, after_s: 43},
    {:one_leader, after_s: 60, to_s: 65},
    {:formed_again, after_s: 43, within_s: 60},
    {:at_most_one_leader, grace_s: 2},
    {:never, :collision}
  ]
]
