defmodule Release.Machine do
  @moduledoc """
  A bare machine to deploy to: a folder with the programs of this one, and its own `/etc`, `/opt`, `/usr/local` and
  `/var`. `ssh` is a script that enters it as root, with the mark by which `bin/test` knows its programs. Needs root
  and mount namespaces.
  """

  @folders ~w(etc opt var/lib run tmp root home dev proc usr local)
  @etc ~w(passwd group shadow gshadow login.defs nsswitch.conf ld.so.cache alternatives os-release)

  @enter """
  #!/bin/sh
  # ssh HOST COMMAND
  [ "$1" = root@machine ] || { echo "no way to $1" >&2; exit 255; }
  exec unshare --mount sh -eu -c '
    cd "$1"
    mount --rbind /usr usr
    mount --bind local usr/local
    mount --rbind /dev dev
    mount --rbind /proc proc
    exec env -i PATH="$PATH" ${CONVOY_RUN:+CONVOY_RUN="$CONVOY_RUN"} chroot . sh -c "$2"
  ' sh MACHINE "$2"
  """

  @doc "Why there can be none here, or `nil`."
  @spec why_not() :: String.t() | nil
  def why_not do
    cond do
      System.cmd("id", ["-u"]) != {"0\n", 0} -> "only root may make machines of folders"
      missing() != [] -> "#{Enum.join(missing(), ", ")} is not here"
      not merged?() -> "/bin is no link to /usr/bin"
      not mounts?() -> "no file system may be mounted here"
      true -> nil
    end
  end

  defp missing,
    do: Enum.reject(~w(unshare chroot useradd usermod getent ldd tar), &System.find_executable/1)

  defp merged?, do: match?({:ok, "usr/bin"}, File.read_link("/bin"))

  defp mounts? do
    test = ["--mount", "mount", "--bind", "/tmp", "/tmp"]
    match?({_text, 0}, System.cmd("unshare", test, stderr_to_stdout: true))
  end

  @doc "A new machine in that folder, and the environment in which ssh reaches it as `root@machine`."
  @spec new(Path.t()) :: {Path.t(), [{String.t(), String.t()}]}
  def new(folder) do
    machine = Path.join(folder, "machine")
    for name <- @folders, do: File.mkdir_p!(Path.join(machine, name))
    for name <- ~w(local/bin etc/systemd/system), do: File.mkdir_p!(Path.join(machine, name))
    File.chmod!(Path.join(machine, "tmp"), 0o1777)

    for name <- ~w(bin sbin lib lib32 lib64 libx32), File.exists?("/usr/#{name}") do
      File.ln_s!("usr/#{name}", Path.join(machine, name))
    end

    for name <- @etc, File.exists?("/etc/#{name}") do
      {_, 0} = System.cmd("cp", ["-a", "/etc/#{name}", Path.join(machine, "etc")])
    end

    ssh = Path.join(folder, "path/ssh")
    File.mkdir_p!(Path.dirname(ssh))
    File.write!(ssh, String.replace(@enter, "MACHINE", machine))
    # As fast as it can: what is packed here is unpacked beside it.
    gzip = Path.join(folder, "path/gzip")
    File.write!(gzip, "#!/bin/sh\nexec #{System.find_executable("gzip")} -1 \"$@\"\n")
    for path <- [ssh, gzip], do: File.chmod!(path, 0o755)
    {machine, [{"PATH", Path.dirname(ssh) <> ":" <> System.get_env("PATH")}]}
  end
end
