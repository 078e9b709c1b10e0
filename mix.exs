Code.require_file("release.exs", __DIR__)

defmodule Convoy.MixProject do
  use Mix.Project

  def project do
    [
      apps_path: "apps",
      apps: apps(System.get_env("CONVOY_BUILD")),
      version: "0.1.0",
      start_permanent: Mix.env() == :prod,
      releases: releases(),
      aliases: [test: &test/1],
      deps: []
    ]
  end

  # The suite of each app in a VM of its own, as bin/test runs them: what one sets does not reach the next. Files are
  # named from here, or as in their app. All suites are run; it fails if one fails.
  defp test(arguments) do
    {files, options} = Enum.split_with(arguments, &String.starts_with?(&1, "apps/"))

    suites =
      Enum.group_by(
        files,
        &(&1 |> Path.split() |> Enum.at(1)),
        &(&1 |> Path.split() |> Enum.drop(2) |> Path.join())
      )

    suites =
      if suites == %{},
        do: Map.new(Mix.Project.apps_paths(), fn {app, _path} -> {"#{app}", []} end),
        else: suites

    for {app, _files} <- suites,
        not File.dir?("apps/#{app}/test"),
        do: Mix.raise("apps/#{app} is not an app with tests")

    failed =
      for {app, files} <- suites,
          Mix.shell().info("==> #{app}"),
          {_out, status} =
            System.cmd("mix", ["test" | options ++ files], cd: "apps/#{app}", into: IO.stream()),
          status != 0,
          do: app

    if failed != [], do: Mix.raise("tests failed in #{Enum.join(failed, ", ")}")
  end

  # With CONVOY_BUILD=robot, say, only what that release holds is built; else all apps are.
  defp apps(release) do
    with {_name, options} <- Enum.find(releases(), &(Atom.to_string(elem(&1, 0)) == release)),
         do: for({app, _mode} <- options[:applications], File.dir?("apps/#{app}"), do: app)
  end

  # `robot` is for real hardware; `fleet` holds robots, worlds and the view of people. Both have ssl, for
  # distribution by TLS (rel/env.sh.eex). Neither has benchmarks.
  defp releases do
    robot =
      Keyword.new(
        [:hal, :vision, :robot, :mesh, :swarm, :missions, :agents, :mcap],
        &{&1, :permanent}
      )

    fleet = robot ++ [sim: :permanent, console: :permanent]

    [
      robot: Convoy.Release.options(applications: robot),
      fleet: Convoy.Release.options(applications: fleet)
    ]
  end

  # The commands read files and print reports; they run in the everyday build.
  def cli, do: [preferred_envs: []]
end
