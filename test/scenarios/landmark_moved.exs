[
  about: "A person pushes the landmark away; the leader follows it, and the fleet its leader.",
  robots: 6,
  seed: 6,
  duration_s: 110,
  script: [
    {40, {:move, {3, 2}}}
  ],
  expect: [
    {:formed, by_s: 40},
    {:formed_again, after_s: 41, within_s: 60},
    {:in_slot, :all, within_m: 0.5, by_s: 100, after_s: 55},
    {:never, :false_claim},
    {:never, :collision},
    {:never, :stuck}
  ]
]
