# Where Convoy is: here two folders up.
convoy = System.get_env("CONVOY", Path.expand("../..", __DIR__))
Code.require_file("release.exs", convoy)

defmodule Gather.MixProject do
  use Mix.Project
  @apps Path.join(convoy, "apps")

  def project do
    [
      app: :gather,
      version: "0.1.0",
      elixir: "~> 1.14",
      start_permanent: Mix.env() == :prod,
      # The robots need `missions`, and `record` where a file says `record:`; `tools` has the simulator, `mix demo`, `mix replay`
      # and the rest, and is not part of the release.
      deps: [
        {:missions, path: Path.join(@apps, "missions")},
        {:record, path: Path.join(@apps, "record")},
        {:tools, path: Path.join(@apps, "tools"), runtime: false}
      ],
      releases: [robot: Convoy.Release.options(applications: [gather: :permanent])]
    ]
  end

  def application, do: [extra_applications: [:logger]]
end
