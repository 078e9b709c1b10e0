[
  inputs: [
    "{mix,native,packages,release,support,.formatter}.exs",
    "config/**/*.exs",
    "test/**/*.exs",
    "examples/**/*.{ex,exs}",
    "apps/*/{mix,.formatter}.exs",
    "apps/*/{lib,test}/**/*.{ex,exs}"
  ]
]
