defmodule Convoy.Release do
  @moduledoc """
  What all releases with robots have in common, for Convoy's own and those of other projects (`docs/missions.md`):

      releases: [robot: Convoy.Release.options(applications: [mine: :permanent])]
  """

  @tls [ssl: :permanent, runtime_tools: :permanent]

  @doc """
  The options of a release with these of its own; its `applications` get what distribution by TLS needs.

  No cookie is made at build time: a robot's comes from its fleet's secret. `h` in a robot's shell needs the
  documentation that is in the code. The start scripts and the settings of the environment are Convoy's.
  """
  @spec options(keyword()) :: keyword()
  def options(own) do
    common = [
      cookie: "none",
      include_executables_for: [:unix],
      strip_beams: [keep: ["Docs"]],
      rel_templates_path: Path.join(__DIR__, "rel"),
      runtime_config_path: Path.join(__DIR__, "config/runtime.exs"),
      steps: [:assemble, &add_robots/1, &write_system/1]
    ]

    common |> Keyword.merge(own) |> Keyword.update(:applications, @tls, &(&1 ++ @tls))
  end

  # The robot files of the project's folder go along, with its bodies; rel/deploy replaces the robot's own by the newest.
  defp add_robots(release) do
    robots = Path.join(release.path, "robots")
    File.rm_rf!(robots)
    if File.dir?("config/robots"), do: File.cp_r!("config/robots", robots)
    if File.dir?("config/bodies"), do: File.cp_r!("config/bodies", Path.join(robots, "bodies"))
    release
  end

  # Where it was built, for rel/install: a release runs on that system only. The first line is what
  # os-release and uname say there, the second what people call it.
  defp write_system(release) do
    script = """
    [ ! -r /etc/os-release ] || . /etc/os-release
    echo "${ID:-$(uname -s)} ${VERSION_ID:-${VERSION_CODENAME:-}} $(uname -m)"
    echo "${PRETTY_NAME:-$(uname -sr)}"
    """

    {system, 0} = System.cmd("sh", ["-c", script])
    File.write!(Path.join(release.path, "system"), system)
    release
  end
end
