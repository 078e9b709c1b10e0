Code.require_file("../../support.exs", __DIR__)

defmodule Lab.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:lab,
      deps: [
        {:missions, in_umbrella: true},
        {:record, in_umbrella: true},
        {:sim, in_umbrella: true},
        {:vm, in_umbrella: true}
      ]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
