[
  about:
    "One robot hears another that does not hear it: a link in one direction is none, and the fleet forms by way of the others.",
  robots: 4,
  cuts: [{0, :end, {:way, :mag1, :min1}}],
  duration_s: 100,
  expect: [
    {:formed, by_s: 90},
    {:agreed, by_s: 40},
    {:never, :collision}
  ]
]
