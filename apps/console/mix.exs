defmodule Console.MixProject do
  use Mix.Project

  def project do
    [
      app: :console,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      elixirc_paths: elixirc_paths(Mix.env()),
      start_permanent: Mix.env() == :prod,
      deps: [{:sim, in_umbrella: true}]
    ]
  end

  def application, do: [extra_applications: [:logger, :crypto | for_tests(Mix.env())]]

  # Mix hides applications of OTP that are not listed. The tests read the pictures' XML.
  defp for_tests(:test), do: [:xmerl]
  defp for_tests(_env), do: []

  defp elixirc_paths(:test), do: ["lib", "test/support"]
  defp elixirc_paths(_env), do: ["lib"]
end
