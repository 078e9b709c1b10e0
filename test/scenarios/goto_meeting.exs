[
  about:
    "Two robots that meet in a door where only one fits both get through: one goes back and waits until the other has passed.",
  robots: [:mag1, :mag2],
  seed: 1,
  map: "doorway",
  landmark: :none,
  duration_s: 95,
  plan: :known,
  script: [
    {1, {:tell, :mag2, "goto:4:0"}},
    {1, {:tell, :mag1, "goto:1:0"}},
    {30, {:tell, :mag2, "goto:-2:0"}},
    {30, {:tell, :mag1, "goto:6:1"}}
  ],
  expect: [
    {:at, :mag1, {6, 1}, within_m: 0.6, by_s: 90},
    {:at, :mag2, {-2, 0}, within_m: 0.6, by_s: 90},
    {:never, :collision}
  ]
]
