[
  about: "Twelve robots in a wedge; one by one they find their places.",
  robots: 12,
  seed: 11,
  duration_s: 120,
  blobs: :direct,
  formation: {:wedge, 1.2},
  expect: [
    {:leader, by_s: 30},
    {:formed, by_s: 110},
    {:never, :bad_anchor},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
