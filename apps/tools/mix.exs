Code.require_file("../../support.exs", __DIR__)

defmodule Tools.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:tools,
      native: [
        nifs: [
          kernel:
            for(
              name <- ~w(blobs runs masks masks_avx2 masks_avx512),
              do: "../../vision/c_src/#{name}.c"
            ) ++
              ["kernel_nif.c"]
        ]
      ],
      deps: [
        {:agents, in_umbrella: true},
        {:bridge, in_umbrella: true},
        {:console, in_umbrella: true},
        {:vm, in_umbrella: true}
      ]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
