# Pioneer 3-DX with both rings of sonars, without bumpers.
# Sources: Adept's data sheet of the Pioneer 3-DX (size, swing radius, mass, greatest speeds); ARIA's parameters, p3dx-sh.p
# (poses of the sonars; the wheel base by which its controller turns); pioneer3dx.xacro (the body about the wheels' axle).
[
  about: "a Pioneer 3-DX",
  mass: 9.0,
  length: 0.455,
  width: 0.381,
  # Its corners are cut off: this is its swing radius.
  radius: 0.267,
  offset: -0.039,
  height: 0.237,
  wheel_base: 0.357,
  limits: [max_linear: 1.2, max_turn: deg(300)],
  # From the left round the front to the right, and from the right round the back to the left.
  sonars: [
    {0.069, 0.136, deg(90)},
    {0.114, 0.119, deg(50)},
    {0.148, 0.078, deg(30)},
    {0.166, 0.027, deg(10)},
    {0.166, -0.027, deg(-10)},
    {0.148, -0.078, deg(-30)},
    {0.114, -0.119, deg(-50)},
    {0.069, -0.136, deg(-90)},
    {-0.157, -0.136, deg(-90)},
    {-0.203, -0.119, deg(-130)},
    {-0.237, -0.078, deg(-150)},
    {-0.255, -0.027, deg(-170)},
    {-0.255, 0.027, deg(170)},
    {-0.237, 0.078, deg(150)},
    {-0.203, 0.119, deg(130)},
    {-0.157, 0.136, deg(90)}
  ],
  sonar_min: 0.16,
  sonar_max: 5.0
]
