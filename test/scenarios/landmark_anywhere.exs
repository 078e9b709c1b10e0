[
  about:
    "A person puts the landmark behind the last robot, where no camera looks; that robot leads, and the fleet forms again.",
  robots: 6,
  seed: 1,
  duration_s: 120,
  blobs: :direct,
  script: [
    {40, {:remove_landmark}},
    {40, {:move, {-7.2, 1.8}}}
  ],
  expect: [
    {:leader_changed, after_s: 40, within_s: 5},
    {:formed_again, after_s: 41, within_s: 60},
    {:never, :collision},
    {:never, :false_claim},
    {:never, :stuck}
  ]
]
