[
  inputs: [
    "{mix,native,packages,.formatter}.exs",
    "config/**/*.exs",
    "test/**/*.exs",
    "apps/*/{mix,.formatter}.exs",
    "apps/*/{lib,test}/**/*.{ex,exs}"
  ]
]
