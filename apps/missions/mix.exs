Code.require_file("../../support.exs", __DIR__)

defmodule Missions.MixProject do
  use Mix.Project

  def project, do: Convoy.Support.project(:missions, deps: [{:swarm, in_umbrella: true}])

  def application, do: [extra_applications: [:logger]]
end
