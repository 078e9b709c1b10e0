Code.require_file("../../support.exs", __DIR__)

defmodule Record.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:record,
      deps: [{:swarm, in_umbrella: true}, {:vm, in_umbrella: true, only: :test}]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
