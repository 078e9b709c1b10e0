Code.require_file("../../support.exs", __DIR__)
Code.require_file("../../native.exs", __DIR__)

defmodule Robot.MixProject do
  use Mix.Project

  def project do
    [
      app: :robot,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: Convoy.Support.compilers([:native | Mix.compilers()], Mix.env()),
      test_ignore_filters: Convoy.Support.files(),
      native: [
        nifs: [
          particles: ["particles.c", "particles_nif.c"],
          silhouettes: ["silhouettes.c", "silhouettes_nif.c"]
        ]
      ],
      start_permanent: Mix.env() == :prod,
      deps: [{:nav, in_umbrella: true}, {:vision, in_umbrella: true}]
    ]
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
