[
  about:
    "A person carries the landmark through a door; the fleet follows in a column, and is a wedge again behind it.",
  robots: 6,
  seed: 1,
  map: "doorway",
  landmark: {-1.0, 0.0},
  duration_s: 200,
  blobs: :direct,
  formation: {:wedge, 1.0},
  script: [
    {60, {:move, {7.5, 0}}}
  ],
  expect: [
    {:formed, by_s: 60},
    {:formed_again, after_s: 75, within_s: 100},
    {:never, :false_claim},
    {:never, :collision},
    {:never, :stuck}
  ]
]
