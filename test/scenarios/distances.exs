[
  about:
    "Requirement 11.10: the distance that a robot measures to the landmark is right within 15 % at 2 m. At 1 m, where the pole is higher than the picture and only its width counts, it is up to 17 % too long.",
  robots: 1,
  duration_s: 40,
  script: [
    {15, {:displace, :mag1, {1, 0, 180}}},
    {20, {:displace, :mag1, {2, 0, 180}}}
  ],
  expect: [
    {:sees_distance, :mag1, within_percent: 20, from_s: 15.2, to_s: 15.4},
    {:sees_distance, :mag1, within_percent: 15, from_s: 20.3, to_s: 22}
  ]
]
