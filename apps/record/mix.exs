Code.require_file("../../support.exs", __DIR__)

defmodule Record.MixProject do
  use Mix.Project

  def project do
    [
      app: :record,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: Convoy.Support.compilers(Mix.compilers(), Mix.env()),
      test_ignore_filters: Convoy.Support.files(),
      start_permanent: Mix.env() == :prod,
      deps: [{:swarm, in_umbrella: true}, {:vm, in_umbrella: true, only: :test}]
    ]
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
