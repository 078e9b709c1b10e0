defmodule Convoy.MixProject do
  use Mix.Project

  def project do
    [
      apps_path: "apps",
      version: "0.1.0",
      start_permanent: Mix.env() == :prod,
      deps: []
    ]
  end

  # The commands read files and print reports; they run in the everyday build.
  def cli, do: [preferred_envs: []]
end
