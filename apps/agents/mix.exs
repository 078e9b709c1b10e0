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
      elixirc_paths: elixirc_paths(Mix.env()),
      start_permanent: Mix.env() == :prod,
      deps: [{:swarm, in_umbrella: true} | packages(Mix.target())]
    ]
  end

  def application, do: [extra_applications: [:logger, :crypto]]

  # Adapters for packages from Hex, with MIX_TARGET=robot. Nothing here needs them.
  defp packages(:host), do: []
  defp packages(_target), do: [{:phoenix_pubsub, "~> 2.1"}]

  defp elixirc_paths(:test), do: ["lib", "test/support"]
  defp elixirc_paths(_env), do: ["lib"]
end
