Code.require_file("../../native.exs", __DIR__)

defmodule Tools.MixProject do
  use Mix.Project

  def project do
    [
      app: :tools,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: [:native | Mix.compilers()],
      native: [nifs: [kernel: ["../../vision/c_src/blobs.c", "kernel_nif.c"]]],
      start_permanent: Mix.env() == :prod,
      deps: [
        {:agents, in_umbrella: true},
        {:console, in_umbrella: true},
        {:vm, in_umbrella: true}
      ]
    ]
  end

  def application, do: [extra_applications: [:logger, :crypto]]
end
