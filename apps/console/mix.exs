Code.require_file("../../support.exs", __DIR__)

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
      compilers: Convoy.Support.compilers(Mix.compilers(), Mix.env()),
      test_ignore_filters: Convoy.Support.files(),
      start_permanent: Mix.env() == :prod,
      deps: [{:lab, in_umbrella: true}]
    ]
  end

  def application,
    do: [extra_applications: [:logger, :crypto] ++ for_tests(Mix.env()) ++ [mochiweb: :optional]]

  # Mix hides applications of OTP that are not listed. mochiweb serves the page, where it is. The tests read the
  # pictures' XML, and have a proxy with HTTPS.
  defp for_tests(:test), do: [:xmerl, :inets, :ssl]
  defp for_tests(_env), do: []
end
