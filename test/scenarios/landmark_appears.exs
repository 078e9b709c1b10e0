[
  about:
    "Robots rest because there is no landmark. Somebody puts one before the camera of one of them: all begin.",
  robots: 3,
  landmark: :none,
  duration_s: 150,
  plan: :none,
  script: [
    {60, {:move, {-3.4, -1.2}}}
  ],
  expect: [
    {:rest, by_s: 60},
    {:leader, by_s: 90, after_s: 60},
    {:formed, by_s: 140, after_s: 60}
  ]
]
