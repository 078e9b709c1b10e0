defmodule Console.Teleop.Gamepad do
  @moduledoc false
  # Drives a robot by a gamepad: ten words a second while a shoulder button is held (`Console.Teleop.Joystick`), one word to stand
  # when it is let go or the gamepad is gone.
  #
  # Debian's `cat` reads the device, so that no thread of the VM waits in it.
  use GenServer, restart: :temporary
  alias Console.Teleop
  alias Console.Teleop.Joystick

  @word_ms 100

  @type option ::
          {:module, module()}
          | {:live, term()}
          | {:robot, atom()}
          | {:path, Path.t()}
          | {:tell, (line :: String.t() -> term())}

  @doc """
  Starts it for a fleet (`module` and `live` as in `Console.Live`); `tell` gets lines for people: that the robot refuses, that the
  gamepad is gone. The error says in one line why the device cannot be read. It is linked to the caller and ends with it.
  """
  @spec start_link([option()]) :: {:ok, pid()} | {:error, line :: String.t()}
  def start_link(options) do
    options = Map.new(options)

    with :ok <- readable(options.path), do: GenServer.start_link(__MODULE__, options)
  end

  defp readable(path) do
    case File.stat(path) do
      {:ok, %{type: type, access: access}}
      when type in [:device, :other] and access in [:read, :read_write] ->
        :ok

      {:ok, %{type: type}} when type in [:device, :other] ->
        {:error, "#{path} cannot be read: whoever drives must be in the group input"}

      {:ok, _file_or_folder} ->
        {:error, "#{path} is no gamepad; /dev/input/js0 is the first"}

      {:error, reason} ->
        {:error, "no gamepad at #{path} (#{:file.format_error(reason)})"}
    end
  end

  @impl GenServer
  def init(options) do
    cat = System.find_executable("cat")
    port = Port.open({:spawn_executable, cat}, [:binary, :exit_status, args: [options.path]])
    {:ok, Map.merge(options, %{port: port, pad: %Joystick{}, driving?: false, refused: nil})}
  end

  @impl GenServer
  def handle_info({port, {:data, bytes}}, %{port: port} = s) do
    s = %{s | pad: Joystick.take(s.pad, bytes)}
    if s.driving? or Joystick.stick(s.pad) == nil, do: {:noreply, s}, else: {:noreply, word(s)}
  end

  def handle_info({port, {:exit_status, _status}}, %{port: port} = s) do
    s = if s.driving?, do: word(%{s | pad: %Joystick{}}), else: s
    s.tell.("the gamepad at #{s.path} is gone; it drives #{s.robot} no more")
    {:stop, :normal, s}
  end

  def handle_info(:word, s), do: {:noreply, word(s)}

  # The first without a hand is the word to stand.
  defp word(s) do
    stick = Joystick.stick(s.pad)
    if stick, do: Process.send_after(self(), :word, @word_ms)
    s = %{s | driving?: stick != nil}

    case s.module.command(s.live, Teleop.order(s.robot, stick || {0.0, 0.0}, :gamepad)) do
      {:ok, _accepted} -> %{s | refused: nil}
      {:error, line} -> refused(s, line)
    end
  end

  # Once, not ten times a second.
  defp refused(%{refused: line} = s, line), do: s

  defp refused(s, line) do
    s.tell.(line)
    %{s | refused: line}
  end
end
