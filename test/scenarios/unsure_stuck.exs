[
  about:
    "Run 93 of chaos seed 1: a follower cannot reach its place in the hospital while it hardly knows where it is. Corrections of its estimate are no progress: it says that it is blocked.",
  robots: [:mag1, :mag2, :mag3, :mag4, :min1, :min2],
  seed: 88151,
  map: "hospital",
  start: :spread,
  landmark: {5.9, -1.0},
  moves: [{{4.0, 0.9}, 45}, {{7.4, 6.1}, 54}, {{8.3, -5.5}, 64}],
  kills: [min1: 19],
  loss: 0.16,
  duplicates: 0.0,
  delay_ms: {5, 50},
  noise: :default,
  duration_s: 127,
  blobs: :direct,
  formation: {:circle, 1.0},
  assign: :cost,
  leader_change: true,
  policy: :available,
  expect: [
    {:never, :stuck}
  ]
]
