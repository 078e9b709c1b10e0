[
  about:
    "By majority, the smaller part of a fleet whose radio is cut has no leader, and follows the leader again when the radio is whole.",
  robots: 5,
  duration_s: 130,
  policy: :majority,
  script: [
    {35, {:cut, [[:mag1, :mag2, :mag3], [:min1, :min2]]}},
    {60, {:join}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:at_most_one_leader, grace_s: 0},
    {:agreed, by_s: 90, after_s: 61},
    {:formed_again, after_s: 60, within_s: 60}
  ]
]
