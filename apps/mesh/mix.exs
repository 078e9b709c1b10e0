Code.require_file("../../support.exs", __DIR__)

defmodule Mesh.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:mesh,
      packages: [libcluster: "~> 3.5"],
      deps: [{:hal, in_umbrella: true}]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
