[
  about:
    "Requirement 11.6: of a fleet whose radio is in two parts from the start, exactly one robot leads in each part.",
  robots: 6,
  cuts: [{0, :end, [[:mag1, :mag2, :mag3], [:min1, :min2, :min3]]}],
  duration_s: 40,
  expect: [
    {:leader, by_s: 20},
    {:one_leader, after_s: 20, to_s: 40}
  ]
]
