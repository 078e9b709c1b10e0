defmodule Vision.Jpeg.Encoder do
  @moduledoc """
  Runs an ffmpeg that encodes frames of one shape as JPEG, one at a time. It runs outside the VM, with one thread and,
  if `nice` exists, with a lower priority. When the process that opened it or the VM ends, its input ends, and ffmpeg
  with it, unless it hangs.

  The process that opens it receives its messages, must trap exits, and passes the messages to
  `handle/2`. No function waits for ffmpeg, even if it hangs: a caller that has waited long enough
  calls `close/1`.
  """
  alias Hal.Frame
  alias Vision.Jpeg

  @enforce_keys [:port, :shape]
  defstruct @enforce_keys ++ [buffer: ""]

  @type t :: %__MODULE__{port: port(), shape: Jpeg.shape(), buffer: binary()}
  @type reason :: :no_ffmpeg | :unreadable | :busy | :late | :no_frame | {:exit, term()}

  @quality 4
  @behind 10

  @doc "The shape of an encoder for this frame."
  @spec shape(Frame.t()) :: Jpeg.shape()
  def shape(%Frame{format: format, width: width, height: height}), do: {format, width, height}

  @doc "Starts ffmpeg; `ffmpeg` is its path, and `nil` looks for it."
  @spec open(Jpeg.shape(), ffmpeg :: Path.t() | nil) :: {:ok, t()} | {:error, :no_ffmpeg}
  def open(shape, ffmpeg \\ nil) do
    case ffmpeg || find() do
      nil -> {:error, :no_ffmpeg}
      path -> {:ok, %__MODULE__{port: start(path, shape), shape: shape}}
    end
  end

  @doc "The path of ffmpeg, if it is installed."
  @spec find() :: Path.t() | nil
  def find, do: System.find_executable("ffmpeg")

  defp start(ffmpeg, shape) do
    arguments = Jpeg.arguments(shape, @quality)

    {program, arguments} =
      case System.find_executable("nice") do
        nil -> {ffmpeg, arguments}
        nice -> {nice, ["-n", "#{@behind}", ffmpeg | arguments]}
      end

    Port.open({:spawn_executable, program}, [:binary, :exit_status, args: arguments])
  end

  @doc """
  Gives the encoder a frame of its shape. The picture arrives in messages; until then the caller
  must not give it another frame.
  """
  @spec encode(t(), Frame.t()) :: :ok | {:error, :busy | :no_frame | {:exit, term()}}
  def encode(%__MODULE__{port: port} = encoder, %Frame{bytes: bytes} = frame) do
    {format, width, height} = encoder.shape

    # With a byte too many or too few, all further pictures would be shifted.
    if Frame.byte_size(format, width, height) == {:ok, byte_size(bytes)} and
         shape(frame) == encoder.shape do
      if :erlang.port_command(port, bytes, [:nosuspend]), do: :ok, else: {:error, :busy}
    else
      {:error, :no_frame}
    end
  rescue
    # The port is closed: ffmpeg has ended, and its last message is on its way.
    ArgumentError -> {:error, {:exit, :closed}}
  end

  @doc "Handles a message; `:unknown` if it is not from this encoder."
  @spec handle(term(), t()) ::
          {:picture, jpeg :: binary(), t()} | {:more, t()} | {:error, reason()} | :unknown
  def handle({port, {:data, bytes}}, %__MODULE__{port: port} = encoder) do
    buffer = encoder.buffer <> bytes

    case Jpeg.take(buffer, Jpeg.longest(encoder.shape)) do
      {:ok, jpeg, rest} -> {:picture, jpeg, %{encoder | buffer: rest}}
      :more -> {:more, %{encoder | buffer: buffer}}
      error -> error
    end
  end

  def handle({port, {:exit_status, status}}, %__MODULE__{port: port}),
    do: {:error, {:exit, status}}

  def handle({:EXIT, port, reason}, %__MODULE__{port: port}), do: {:error, {:exit, reason}}
  def handle(_other, _encoder), do: :unknown

  @doc "Ends ffmpeg, even one that hangs and would not notice the end of its input."
  @spec close(t()) :: :ok
  def close(%__MODULE__{port: port}) do
    # As long as the port is open, no other process can have this number.
    with {:os_pid, pid} <- Port.info(port, :os_pid),
         path when path != nil <- System.find_executable("kill"),
         do: System.cmd(path, ["-9", "#{pid}"], stderr_to_stdout: true)

    send(port, {self(), :close})
    :ok
  end

  @doc """
  Describes a reason in words.

      iex> Vision.Jpeg.Encoder.explain(:no_ffmpeg)
      "the program ffmpeg is missing (on Debian: apt install ffmpeg)"
  """
  @spec explain(reason()) :: String.t()
  def explain(:no_ffmpeg), do: Hal.Camera.FFmpeg.explain(:no_ffmpeg)
  def explain(:unreadable), do: "ffmpeg gave something that is not a picture"
  def explain(:busy), do: "ffmpeg takes no frame"
  def explain(:late), do: "ffmpeg gave no picture in time"
  def explain(:no_frame), do: "the camera gave something that is not a frame"

  def explain({:exit, reason}),
    do: "ffmpeg ended (#{inspect(reason, limit: 5, printable_limit: 40)})"
end
