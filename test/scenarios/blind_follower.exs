[
  about: "A robot has no camera; another one tells it where it stands, and all are in place.",
  robots: 6,
  duration_s: 180,
  plan: :none,
  script: [
    {0, {:blind, :min1, 180}}
  ],
  expect: [
    {:formed, by_s: 120},
    {:in_slot, :all, within_m: 0.5, by_s: 120},
    {:never, :collision},
    {:never, :false_claim}
  ]
]
