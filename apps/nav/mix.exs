Code.require_file("../../support.exs", __DIR__)

defmodule Nav.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:nav,
      native: [
        nifs: [grid: ["grid.c", "grid_nif.c"], occupancy: ["occupancy.c", "occupancy_nif.c"]]
      ],
      deps: [{:hal, in_umbrella: true}]
    )
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
