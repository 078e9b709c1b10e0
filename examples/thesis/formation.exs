[
  about:
    "Experiment 4, Figure 12: all search for the landmark, tell each other what they saw, and line up behind the one that is nearest; a person moves the landmark, the leader turns, and the line is there again.",
  robots: 4,
  seed: 1,
  map: "hall",
  duration_s: 120,
  script: [
    {40, {:move, {3, 2}}}
  ],
  expect: [
    {:agreed, by_s: 30},
    {:formed, by_s: 40},
    {:formed_again, after_s: 41, within_s: 60},
    {:in_slot, :all, within_m: 0.5, by_s: 110, after_s: 55},
    {:at_most_one_leader, grace_s: 2},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
