defmodule Vision.Saver do
  @moduledoc """
  Saves pictures of a camera in a folder: a viewer of `Vision.View` that writes what it
  receives. The newest are kept and the oldest deleted (`Vision.Saver.Retention`); other files in
  the folder are left alone.

  Options:

    * `:folder` - where; it must exist, so that pictures for a disk that is not mounted do not
      fill another one
    * `:rate` - how many per second, 0.001 to 30, default 1
    * `:files` - how many are kept, 1 to 100,000, default 1000
    * `:megabytes` - how many MB (10^6 bytes) are kept, 1 to 1,000,000, default 100
    * `:prefix` - what the file names begin with: the name of the robot
    * `:view` - the `Vision.View` to watch
    * `:name` - as in `GenServer`

  A picture is written under another name and then renamed, so that no reader finds half of one. A
  failure (a full disk, a folder that is gone) is reported once by `[:vision, :saver, :failed]`
  and shown by `status/1`. The saver tries again after 1 s, 2 s, … up to 30 s; when it succeeds,
  `[:vision, :saver, :healed]` follows. A slow disk delays only this process: it requests the next
  picture when the last one is written. A full disk does not make it delete more than its limits
  require.
  """
  use GenServer
  alias Hal.Event
  alias Vision.Saver.{Options, Retention}
  alias Vision.View

  @rest_ms 1_000
  @longest_rest_ms 30_000
  # The ending of a file that is being written, or was when the power failed.
  @part ".part"

  @type status :: %{
          files: non_neg_integer(),
          bytes: non_neg_integer(),
          saved: non_neg_integer(),
          why: String.t() | nil
        }

  @doc "Checks the options that people give, and adds the defaults; the error says what is wrong."
  @spec options(term()) :: {:ok, keyword()} | {:error, line :: String.t()}
  defdelegate options(options), to: Options, as: :check

  @doc "Starts saving. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {ours, given} = Keyword.split(options, [:prefix, :view, :name])

    case options(given) do
      {:ok, given} ->
        GenServer.start_link(__MODULE__, given ++ ours, Keyword.take(ours, [:name]))

      {:error, line} ->
        raise ArgumentError, line
    end
  end

  @doc """
  How much is kept, how many pictures were saved since the start, and why none are at present
  (`nil`: they are).
  """
  @spec status(GenServer.server()) :: status()
  def status(saver), do: GenServer.call(saver, :status)

  @impl GenServer
  def init(options) do
    state = %{retention: nil, ref: nil, saved: 0, why: nil, rest_ms: @rest_ms}
    {:ok, Map.merge(Map.new(options), state), {:continue, :again}}
  end

  @impl GenServer
  def handle_continue(:again, s), do: {:noreply, again(s)}

  @impl GenServer
  def handle_call(:status, _from, s) do
    {files, bytes} = if s.retention, do: Retention.size(s.retention), else: {0, 0}
    {:reply, %{files: files, bytes: bytes, saved: s.saved, why: s.why}, s}
  end

  @impl GenServer
  def handle_info({:picture, ref, picture}, %{ref: ref} = s) do
    case save(s, picture.jpeg) do
      {:ok, s} ->
        View.next(s.view, ref)
        {:noreply, healed(%{s | saved: s.saved + 1})}

      {:error, reason} ->
        # The folder is read again: a person may have made room, or changed the disk.
        {:noreply, failed(%{s | retention: nil}, reason)}
    end
  end

  def handle_info(:again, s), do: {:noreply, again(s)}

  # The view crashed, and is restarted soon.
  def handle_info({:DOWN, ref, :process, _pid, _reason}, %{ref: ref} = s) do
    Process.send_after(self(), :again, @rest_ms)
    {:noreply, %{s | ref: nil}}
  end

  def handle_info(_late, s), do: {:noreply, s}

  defp again(s) do
    with {:ok, retention} <- retention(s), {:ok, ref} <- look(s) do
      %{s | retention: retention, ref: ref}
    else
      {:error, reason} -> failed(s, reason)
    end
  end

  defp look(%{ref: nil} = s), do: View.subscribe(s.view, rate: s.rate)

  defp look(s) do
    View.next(s.view, s.ref)
    {:ok, s.ref}
  end

  defp retention(%{retention: nil} = s) do
    with {:ok, names} <- File.ls(s.folder) do
      {parts, names} = Enum.split_with(names, &String.ends_with?(&1, @part))

      for part <- parts,
          Retention.time_ms(s.prefix, Path.rootname(part, @part)) != nil,
          do: File.rm(Path.join(s.folder, part))

      there =
        for name <- names,
            Retention.time_ms(s.prefix, name) != nil,
            {:ok, %File.Stat{type: :regular, size: size}} <- [
              File.lstat(Path.join(s.folder, name))
            ],
            do: {name, size}

      {:ok, Retention.new(s.prefix, s.files, s.megabytes * 1_000_000, there)}
    end
  end

  defp retention(s), do: {:ok, s.retention}

  defp save(s, jpeg) do
    name = Retention.name(s.retention, System.system_time(:millisecond))
    path = Path.join(s.folder, name)

    with {:ok, old, retention} <- Retention.room(s.retention, byte_size(jpeg)),
         :ok <- remove(old, s.folder),
         :ok <- write(path, jpeg) do
      {:ok, %{s | retention: Retention.put(retention, name, byte_size(jpeg))}}
    end
  end

  # If the file is gone already, there is nothing to do.
  defp remove(names, folder) do
    Enum.find_value(names, :ok, fn name ->
      case File.rm(Path.join(folder, name)) do
        gone when gone in [:ok, {:error, :enoent}] -> nil
        error -> error
      end
    end)
  end

  defp write(path, jpeg) do
    with :ok <- File.write(path <> @part, jpeg), :ok <- File.rename(path <> @part, path) do
      :ok
    else
      error ->
        _half = File.rm(path <> @part)
        error
    end
  end

  defp failed(s, reason) do
    line = "no pictures are saved in #{s.folder}: #{explain(reason)}"
    about = %{folder: s.folder, reason: reason, line: line}

    if line != s.why,
      do: Event.execute([:vision, :saver, :failed], %{at_ms: Hal.Clock.now_ms()}, about)

    Process.send_after(self(), :again, s.rest_ms)
    %{s | why: line, rest_ms: min(2 * s.rest_ms, @longest_rest_ms)}
  end

  defp healed(%{why: nil} = s), do: s

  defp healed(s) do
    Event.execute([:vision, :saver, :healed], %{at_ms: Hal.Clock.now_ms()}, %{folder: s.folder})
    %{s | why: nil, rest_ms: @rest_ms}
  end

  defp explain(line) when is_binary(line), do: line
  defp explain(:too_large), do: "one picture is larger than all that may be kept"
  defp explain(reason), do: to_string(:file.format_error(reason))
end
