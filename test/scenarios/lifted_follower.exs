[
  about:
    "A follower is lifted to another room. It says that it is lost, finds itself by the plan, and all are in formation again.",
  robots: 4,
  seed: 2,
  map: "rooms:3",
  blobs: :direct,
  duration_s: 240,
  script: [{80, {:displace, :mag2, {-5.0, 4.0, 120.0}}}],
  expect: [
    {:formed, by_s: 80},
    {:says, :mag2, :unsure, after_s: 80, by_s: 100},
    {:formed_again, after_s: 80, within_s: 150},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
