Code.require_file("../../support.exs", __DIR__)

defmodule Robot.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:robot,
      native: [
        nifs: [
          particles: ["particles.c", "particles_nif.c"],
          silhouettes: ["silhouettes.c", "silhouettes_nif.c"]
        ]
      ],
      deps: [{:nav, in_umbrella: true}, {:vision, in_umbrella: true}]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
