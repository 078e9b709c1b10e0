[
  about:
    "Experiment 6: a robot whose wheels slip turns by 90 degrees and back. In the thesis the world of min1 was turned by 10 degrees then; a robot that has the floor plan finds by its sonars how it stands.",
  robots: [:min1],
  seed: 2,
  landmark: :none,
  noise: :slip,
  duration_s: 60,
  script: [
    {0, {:tell, :min1, "goto:0:0:0"}},
    {20, {:tell, :min1, "goto:0:0:1.5708"}},
    {35, {:tell, :min1, "goto:0:0:0"}}
  ],
  expect: [
    {:turned, :min1, 90, within_deg: 10, by_s: 35, after_s: 20},
    {:turned, :min1, -90, within_deg: 10, by_s: 60, after_s: 35},
    {:at, :min1, {0, 0}, within_m: 0.3, by_s: 60, after_s: 45}
  ]
]
