Code.require_file("../../support.exs", __DIR__)

defmodule Agents.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:agents,
      packages: [phoenix_pubsub: "~> 2.1"],
      deps: [{:swarm, in_umbrella: true}]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
