defmodule Player.MixProject do
  use Mix.Project

  # Where Convoy is: here two folders up.
  @convoy System.get_env("CONVOY", Path.expand("../..", __DIR__))

  # What Convoy's own tests were built with does for the tests here, too.
  def project do
    [
      app: :player,
      version: "0.1.0",
      elixir: "~> 1.14",
      build_path: Path.join(@convoy, "_build"),
      config_path: Path.join(@convoy, "config/config.exs"),
      start_permanent: Mix.env() == :prod,
      deps: [{:bridge, path: Path.join(@convoy, "apps/bridge"), env: Mix.env()}]
    ]
  end

  def application, do: [extra_applications: [:logger]]
end
