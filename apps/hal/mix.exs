Code.require_file("../../support.exs", __DIR__)

defmodule Hal.MixProject do
  use Mix.Project

  def project do
    Convoy.Support.project(:hal,
      native: [
        programs: [
          newest_frame: ["newest_frame.c", "y4m.c"],
          serial: ["serial.c", "serial_main.c"]
        ]
      ],
      packages: [circuits_uart: "~> 1.5.5"],
      deps: [
        {:vm, in_umbrella: true, only: :test}
      ]
    )
  end

  def application, do: [mod: {Hal.Application, []}, extra_applications: [:logger, :crypto]]
end
