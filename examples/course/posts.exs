[
  about:
    "Exercise 3: the mission `posts` keeps three places occupied by four robots, also after one dies, with lost messages.",
  robots: [:mag1, :mag2, :min1, :min2],
  seed: 3,
  landmark: :none,
  mission: :posts,
  loss: 0.3,
  duration_s: 200,
  script: [{80, {:kill, :mag1}}],
  expect: [
    {:at, :mag1, {-4, 3}, within_m: 0.3, by_s: 75},
    {:at, :mag2, {4, 3}, within_m: 0.3, by_s: 75},
    {:at, :min1, {0, -4}, within_m: 0.3, by_s: 75},
    {:at, :min2, {-4, 3}, within_m: 1.0, after_s: 81, by_s: 180},
    {:still, :mag2, from_s: 82, to_s: 180},
    {:still, :min1, from_s: 82, to_s: 180},
    {:never, :collision}
  ]
]
