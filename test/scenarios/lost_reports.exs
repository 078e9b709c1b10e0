[
  about:
    "Requirement 11.5: all messages are lost while the robots report what they see. Nobody waits for ever.",
  robots: 6,
  duration_s: 90,
  script: [
    {7, {:loss, 1}},
    {12, {:loss, 0}}
  ],
  expect: [
    {:agreed, by_s: 40, after_s: 12},
    {:formed, by_s: 80},
    {:never, :collision}
  ]
]
