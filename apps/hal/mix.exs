Code.require_file("../../support.exs", __DIR__)
Code.require_file("../../native.exs", __DIR__)
Code.require_file("../../packages.exs", __DIR__)

defmodule Hal.MixProject do
  use Mix.Project

  def project do
    [
      app: :hal,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: Convoy.Support.compilers([:native, :packages | Mix.compilers()], Mix.env()),
      test_ignore_filters: Convoy.Support.files(),
      native: [
        programs: [
          newest_frame: ["newest_frame.c", "y4m.c"],
          serial: ["serial.c", "serial_main.c"]
        ]
      ],
      start_permanent: Mix.env() == :prod,
      deps: [
        {:vm, in_umbrella: true, only: :test} | Convoy.Packages.list(circuits_uart: "~> 1.5.5")
      ]
    ]
  end

  def application, do: [mod: {Hal.Application, []}, extra_applications: [:logger, :crypto]]
end
