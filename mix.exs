Code.require_file("release.exs", __DIR__)

# With LC_ALL=C Erlang takes an umlaut for two letters, and finds no file whose name has one. The scripts in bin set it.
if :file.native_name_encoding() == :latin1 and Enum.any?(System.argv(), &(&1 =~ ~r/[^\x00-\x7F]/)) do
  IO.puts(:stderr, "mix: the options hold letters that need UTF-8: export LC_ALL=C.UTF-8")
  exit({:shutdown, 1})
end

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

  # Each suite in a VM of its own, as bin/test runs them: what one sets does not reach the next. Without files: the apps, the
  # projects of examples/, and of the whole system what needs no release, no network of its own and no documents; bin/test has
  # all. Files are named from here. All suites are run; it fails if one fails.
  @system ["--except", "release,netns,docs,test_command,test_on"]

  defp test(arguments) do
    {files, options} = Enum.split_with(arguments, &(&1 =~ ~r{/|\.exs(:\d+)?$}))

    suites =
      if files == [],
        do: Enum.map(folders(), &{&1, if(&1 == ".", do: @system, else: [])}),
        else: files |> Enum.group_by(&folder/1) |> Enum.sort_by(&elem(&1, 0), :desc)

    failed =
      for {folder, files} <- suites,
          Mix.shell().info("==> #{folder}"),
          {command, options} = command(folder, options, Enum.map(files, &relative(&1, folder))),
          {_out, status} =
            System.cmd("mix", command ++ options,
              cd: folder,
              env: [{"MIX_ENV", "test"}],
              into: IO.stream()
            ),
          status != 0,
          do: folder

    if failed != [], do: Mix.raise("tests failed in #{Enum.join(failed, ", ")}")
  end

  defp command(".", options, files),
    do: {["run", "--no-start", "test/run.exs"], files ++ options}

  defp command(_folder, options, files), do: {["test"], options ++ files}

  defp folders do
    apps =
      for {_app, path} <- Enum.sort(Mix.Project.apps_paths()), File.dir?("#{path}/test"), do: path

    projects =
      for helper <- Enum.sort(Path.wildcard("examples/*/test/test_helper.exs")),
          do: helper |> Path.dirname() |> Path.dirname()

    apps ++ projects ++ ["."]
  end

  # The suite that a file or folder belongs to.
  defp folder(file) do
    with true <- file |> String.replace(~r/:\d+$/, "") |> File.exists?(),
         folder when folder != nil <-
           Enum.find(
             folders(),
             &(String.starts_with?(file, &1 <> "/") or
                 (&1 == "." and String.starts_with?(file, "test/")))
           ) do
      folder
    else
      _none ->
        Mix.raise(
          "#{file} is no test of this project; name a file or folder below apps/, examples/ or test/"
        )
    end
  end

  defp relative(file, "."), do: file
  defp relative(file, folder), do: String.replace_prefix(file, folder <> "/", "")

  # With CONVOY_BUILD=robot, say, only what that release holds is built; with CONVOY_BUILD=demo all but the tools, as
  # bin/build does it; else all apps are.
  defp apps("demo") do
    for mix <- Enum.sort(Path.wildcard("apps/*/mix.exs")),
        app = mix |> Path.dirname() |> Path.basename(),
        app != "tools",
        do: String.to_atom(app)
  end

  defp apps(release) do
    with {_name, options} <- Enum.find(releases(), &(Atom.to_string(elem(&1, 0)) == release)),
         do: for({app, _mode} <- options[:applications], File.dir?("apps/#{app}"), do: app)
  end

  # `robot` is for real hardware; `fleet` holds robots, worlds and the view of people. Both have ssl, for
  # distribution by TLS (rel/env.sh.eex). Neither has the tools.
  defp releases do
    robot =
      Keyword.new(
        [:hal, :nav, :vision, :robot, :mesh, :swarm, :missions, :record, :agents],
        &{&1, :permanent}
      )

    fleet = robot ++ [sim: :permanent, lab: :permanent, console: :permanent, bridge: :permanent]

    [
      robot: Convoy.Release.options(applications: robot),
      fleet: Convoy.Release.options(applications: fleet)
    ]
  end

  # The commands read files and print reports; they run in the everyday build.
  def cli, do: [preferred_envs: []]
end
