[
  about:
    "The landmark is taken away for good; its leader looks where it was, all search for it, and rest.",
  robots: 6,
  duration_s: 300,
  script: [
    {35, {:remove_landmark}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:rest, by_s: 200},
    {:never, :collision}
  ]
]
