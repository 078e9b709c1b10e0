Code.require_file("../../support.exs", __DIR__)
Code.require_file("../../packages.exs", __DIR__)

defmodule Agents.MixProject do
  use Mix.Project

  def project do
    [
      app: :agents,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: Convoy.Support.compilers([:packages | Mix.compilers()], Mix.env()),
      test_ignore_filters: Convoy.Support.files(),
      start_permanent: Mix.env() == :prod,
      deps: [{:swarm, in_umbrella: true} | Convoy.Packages.list(phoenix_pubsub: "~> 2.1")]
    ]
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
