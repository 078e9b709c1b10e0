defmodule Lab.Fleet.Folder do
  @moduledoc false
  # Makes a run's own temporary folder, which only this user can read. It is removed with the process that made it,
  # however that ends, by a signal to all of the VM or by its crash: a shell holds the other end of a pipe, and removes
  # the folder when the pipe is closed. Should the shell be killed as well, the next run removes what is left.

  # It reads until the VM has ended in any way, or the process whose port this is. What other
  # processes, which end at the same time, may still write is removed a second later.
  @keeper """
  trap '' INT TERM HUP QUIT
  read -r _nothing
  rm -rf -- "$1"
  sleep 1
  rm -rf -- "$1"
  """

  @doc "Creates a folder, for as long as the calling process runs."
  @spec make() :: {:ok, Path.t()} | {:error, line :: String.t()}
  def make do
    sweep(System.tmp_dir!())
    number = Base.encode16(:crypto.strong_rand_bytes(4), case: :lower)
    folder = Path.join(System.tmp_dir!(), "convoy-#{System.pid()}-#{number}")

    with :ok <- File.mkdir(folder), :ok <- File.chmod(folder, 0o700) do
      keep(folder)
      System.at_exit(fn _status -> File.rm_rf(folder) end)
      {:ok, folder}
    else
      {:error, reason} -> {:error, "#{folder} cannot be made: #{:file.format_error(reason)}"}
    end
  end

  @doc "Removes it with all its contents."
  @spec remove(Path.t()) :: :ok
  def remove(folder) do
    _ = File.rm_rf(folder)
    :ok
  end

  defp keep(folder) do
    sh = System.find_executable("sh")
    Port.open({:spawn_executable, sh}, [:hide, args: ["-c", @keeper, "keeper", folder]])
  end

  # The name contains the number of the process.
  defp sweep(folder) do
    with true <- File.dir?("/proc/self"), {:ok, names} <- File.ls(folder) do
      for name <- names,
          [_all, pid] <- [Regex.run(~r/^convoy-(\d+)-[0-9a-f]{8}$/, name)],
          not File.dir?("/proc/#{pid}"),
          do: File.rm_rf(Path.join(folder, name))
    end
  end
end
