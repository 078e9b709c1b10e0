[
  about: "A circle of six.",
  robots: 6,
  seed: 3,
  duration_s: 110,
  formation: {:circle, 1.0},
  expect: [
    {:formed, by_s: 100},
    {:in_slot, :all, within_m: 0.5, by_s: 100},
    {:never, :bad_anchor},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
