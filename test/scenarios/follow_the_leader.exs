[
  about: "A person tells one robot to drive, and another one to follow it: it keeps 1 m behind.",
  robots: [:mag1, :mag2],
  seed: 1,
  landmark: :none,
  duration_s: 60,
  script: [
    {0, {:tell, :all, :stop}},
    {0.5, {:tell, :mag1, "goto:-4:-3"}},
    {1, {:tell, :mag2, "followtheleader:mag1"}}
  ],
  expect: [
    {:at, :mag1, {-4, -3}, within_m: 0.3, by_s: 50},
    {:moves, :mag2, by_s: 30},
    {:phase, :mag2, :follow_the_leader, by_s: 5},
    {:at, :mag2, {-4, -3}, within_m: 1.5, by_s: 60},
    {:never, :collision}
  ]
]
