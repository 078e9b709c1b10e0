defmodule Soak.MixProject do
  use Mix.Project

  # Where Convoy is: here two folders up.
  @convoy System.get_env("CONVOY", Path.expand("../..", __DIR__))

  def project do
    [
      app: :soak,
      version: "0.1.0",
      build_path: Path.join(@convoy, "_build"),
      config_path: Path.join(@convoy, "config/config.exs"),
      elixir: "~> 1.14",
      start_permanent: Mix.env() == :prod,
      deps:
        for(
          app <- [:console, :vm],
          do: {app, path: Path.join(@convoy, "apps/#{app}"), env: Mix.env()}
        )
    ]
  end

  def application, do: [extra_applications: [:logger]]
end
