[
  about:
    "A robot that is sent through a door in which another stands gives up, says so, and stands; another way it goes.",
  robots: 2,
  seed: 1,
  map: "doorway",
  landmark: :none,
  duration_s: 75,
  plan: :known,
  script: [
    {0.5, {:tell, :min1, :stop}},
    {0.5, {:displace, :min1, {2.5, 0, 90}}},
    {1, {:tell, :mag1, "goto:-4:0"}},
    {60, {:tell, :mag1, "goto:7:2"}}
  ],
  expect: [
    {:phase, :mag1, :given_up, by_s: 45},
    {:still, :mag1, from_s: 50, to_s: 59},
    {:at, :mag1, {7, 2}, within_m: 0.4, by_s: 75},
    {:never, :collision}
  ]
]
