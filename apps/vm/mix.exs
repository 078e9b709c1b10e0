Code.require_file("../../native.exs", __DIR__)

defmodule Vm.MixProject do
  use Mix.Project

  def project do
    [
      app: :vm,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: [:native | Mix.compilers()],
      native: [programs: [leash: ["leash.c"]]],
      start_permanent: Mix.env() == :prod
    ]
  end

  def application, do: [extra_applications: [:crypto]]
end
