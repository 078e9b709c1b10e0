[
  about:
    "Experiment 5: both classes of robots in one group, with wheels that slip, so that each has its own idea of the room. In the thesis the views of the world diverged; here each says where it is by what it sees.",
  robots: 4,
  seed: 3,
  noise: :slip,
  duration_s: 120,
  script: [
    {50, {:move, {-3, 2}}}
  ],
  expect: [
    {:formed, by_s: 50},
    {:formed_again, after_s: 51, within_s: 60},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
