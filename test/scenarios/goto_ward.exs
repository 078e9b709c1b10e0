[
  about:
    "A robot that has the floor plan goes from the hall through doors and a corridor into a room that it does not see.",
  robots: 2,
  seed: 1,
  map: "hospital",
  landmark: :none,
  duration_s: 75,
  plan: :known,
  script: [
    {1, {:tell, :mag1, "goto:10.7:11.5"}},
    {1, {:tell, :min1, "goto:-10.7:-11.5"}}
  ],
  expect: [
    {:at, :mag1, {10.7, 11.5}, within_m: 0.4, by_s: 70},
    {:at, :min1, {-10.7, -11.5}, within_m: 0.4, by_s: 70},
    {:never, :collision}
  ]
]
