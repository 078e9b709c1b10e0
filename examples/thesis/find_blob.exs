[
  about:
    "Experiment 2: a robot turns until it sees the landmark behind it, centres it, and measures how far it is (Table 2: 1 m and 2 m).",
  robots: 1,
  duration_s: 60,
  script: [
    {0, {:displace, :mag1, {3, 0, 0}}},
    {0, {:tell, :mag1, "findblob"}},
    {25, {:tell, :mag1, :start}},
    {30, {:displace, :mag1, {1, 0, 180}}},
    {36, {:displace, :mag1, {2, 0, 180}}}
  ],
  expect: [
    {:phase, :mag1, :found, by_s: 20},
    {:sees_distance, :mag1, within_percent: 20, from_s: 31, to_s: 34},
    {:sees_distance, :mag1, within_percent: 15, from_s: 37, to_s: 40}
  ]
]
