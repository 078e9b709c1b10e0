[
  about: "A person tells the fleet to form a line instead of its column, while it stands.",
  robots: 4,
  duration_s: 110,
  script: [
    {35, {:tell, :all, {:formation, :line, 1.2}}}
  ],
  expect: [
    {:formed, by_s: 35},
    {:moves, :mag2, by_s: 45, after_s: 35},
    {:formed_again, after_s: 36, within_s: 60},
    {:in_slot, :all, within_m: 0.5, by_s: 80, after_s: 45},
    {:never, :bad_anchor},
    {:never, :collision}
  ]
]
