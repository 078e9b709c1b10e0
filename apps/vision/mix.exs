Code.require_file("../../support.exs", __DIR__)

defmodule Vision.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:vision,
      native: [
        nifs: [
          blobs: ["blobs.c", "runs.c", "masks.c", "blobs_nif.c"],
          similar: [
            "similar.c",
            "similar_fit.c",
            "similar_read.c",
            "blobs.c",
            "runs.c",
            "masks.c",
            "marks_terms.c",
            "similar_nif.c"
          ]
        ],
        optional: [
          marks:
            {"apriltag", "apriltag/apriltag.h",
             ["marks.c", "blobs.c", "runs.c", "masks.c", "marks_terms.c", "marks_nif.c"]}
        ]
      ],
      packages: [nx: "~> 0.6", evision: "~> 0.2.10"],
      deps: [
        {:hal, in_umbrella: true}
      ]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
