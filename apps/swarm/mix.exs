Code.require_file("../../support.exs", __DIR__)

defmodule Swarm.MixProject do
  use Mix.Project

  def project,
    do:
      Convoy.Support.project(:swarm,
        deps: [{:robot, in_umbrella: true}, {:mesh, in_umbrella: true}]
      )

  def application, do: [mod: {Swarm.Application, []}, extra_applications: [:logger, :crypto]]
end
