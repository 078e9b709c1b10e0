[
  about:
    "Experiment 3: a robot is told to follow another one, which is told to drive to two places: it stays behind it. In the thesis: `followtheleader:player1`, sections 5.3.4 and 6.2, unchanged on real robots.",
  robots: [:mag1, :mag2],
  seed: 1,
  landmark: :none,
  duration_s: 90,
  script: [
    {0, {:tell, :all, :stop}},
    {0.5, {:tell, :mag1, "goto:-4:-3"}},
    {1, {:tell, :mag2, "followtheleader:mag1"}},
    {45, {:tell, :mag1, "goto:0:-3"}}
  ],
  expect: [
    {:at, :mag1, {-4, -3}, within_m: 0.3, by_s: 45},
    {:at, :mag2, {-4, -3}, within_m: 1.5, by_s: 55},
    {:at, :mag1, {0, -3}, within_m: 0.3, by_s: 80, after_s: 45},
    {:at, :mag2, {0, -3}, within_m: 1.5, by_s: 90, after_s: 60},
    {:never, :collision}
  ]
]
