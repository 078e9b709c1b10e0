[
  about:
    "Requirement 11.2: a robot told to find a landmark that is not there gives up after one turn, give or take a tenth.",
  robots: 1,
  landmark: :none,
  duration_s: 40,
  script: [
    {0, {:tell, :mag1, "findblob"}}
  ],
  expect: [
    {:phase, :mag1, :not_found, by_s: 30},
    {:never_phase, :mag1, :found},
    {:turned, :mag1, 360, within_deg: 36, by_s: 30},
    {:still, :mag1, from_s: 30, to_s: 35}
  ]
]
