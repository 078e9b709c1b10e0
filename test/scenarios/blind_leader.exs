[
  about: "The camera of the leader gives no pictures for 10 s; the fleet forms again.",
  robots: 6,
  duration_s: 120,
  script: [
    {35, {:blind, :leader, 10}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:formed_again, after_s: 36, within_s: 60},
    {:at_most_one_leader, grace_s: 2},
    {:never, :collision}
  ]
]
