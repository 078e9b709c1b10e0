Code.require_file("../../support.exs", __DIR__)

defmodule Sim.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:sim,
      native: [
        nifs: [kernel: ["rays.c", "walls.c", "paint.c", "regions.c", "kernel_nif.c"]]
      ],
      deps: [{:nav, in_umbrella: true}, {:vision, in_umbrella: true}]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
