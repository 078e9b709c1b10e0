Code.require_file("../../support.exs", __DIR__)

defmodule Vision.MixProject do
  use Mix.Project

  @finder ~w(blobs.c runs.c masks.c masks_avx2.c masks_avx512.c)

  def project do
    Convoy.Support.project(:vision,
      native: [
        nifs: [
          blobs: @finder ++ ["blobs_nif.c"],
          similar:
            ["similar.c", "similar_fit.c", "similar_read.c"] ++
              @finder ++ ["marks_terms.c", "similar_nif.c"]
        ],
        optional: [
          marks:
            {"apriltag", "apriltag/apriltag.h",
             ["marks.c"] ++ @finder ++ ["marks_terms.c", "marks_nif.c"]}
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
