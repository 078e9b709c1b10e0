[
  about: "The landmark is taken away and put elsewhere; the fleet finds it again.",
  robots: 4,
  duration_s: 140,
  script: [
    {35, {:remove_landmark}},
    {50, {:move, {4, 3}}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:formed_again, after_s: 50, within_s: 80},
    {:never, :collision}
  ]
]
