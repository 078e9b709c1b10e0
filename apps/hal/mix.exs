Code.require_file("../../native.exs", __DIR__)

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
      compilers: [:native | Mix.compilers()],
      native: [
        programs: [
          newest_frame: ["newest_frame.c", "y4m.c"],
          serial: ["serial.c", "serial_main.c"]
        ]
      ],
      elixirc_paths: elixirc_paths(Mix.env()),
      start_permanent: Mix.env() == :prod,
      deps: [{:vm, in_umbrella: true, only: :test} | packages(Mix.target())]
    ]
  end

  def application, do: [mod: {Hal.Application, []}, extra_applications: [:logger, :crypto]]

  # Adapters for what Hex has; with MIX_TARGET=hex, say. Nothing here needs them.
  defp packages(:host), do: []
  defp packages(_target), do: [{:circuits_uart, "~> 1.5.5"}]

  defp elixirc_paths(:test), do: ["lib", "test/support"]
  defp elixirc_paths(_env), do: ["lib"]
end
