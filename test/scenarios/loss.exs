[
  about:
    "A third of all messages is lost all the time; the fleet forms, and never has two leaders for more than a moment.",
  robots: 6,
  seed: 2,
  loss: 0.33,
  duration_s: 90,
  expect: [
    {:formed, by_s: 80},
    {:at_most_one_leader, grace_s: 2},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
