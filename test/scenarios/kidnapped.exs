[
  about:
    "A follower is lifted to a place from where it sees none of the others, which its wheels do not count. It says that it is not sure of its place, and the leader claims no formation.",
  robots: 6,
  duration_s: 87,
  script: [
    {40, {:displace, :mag1, {-4, 3, 90}}}
  ],
  expect: [
    {:formed, by_s: 40},
    {:says, :mag1, :unsure, by_s: 52, after_s: 41},
    {:not_formed, from_s: 52, to_s: 67},
    {:never, :false_claim},
    {:never, :collision}
  ]
]
