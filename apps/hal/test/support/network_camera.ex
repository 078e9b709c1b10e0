defmodule Hal.NetworkCamera do
  @moduledoc """
  A camera that sends JPEG pictures, ten a second, to those that connect to a local socket: black ones or white ones. For
  `Hal.CameraCase`; the option `link` is the path of the socket.
  """
  use GenServer
  @behaviour Hal.Emulated
  @behaviour Hal.CameraCase

  @period_ms 100
  @comment 60_000
  @comments 8
  # Darker than this is black, and brighter than this white.
  @black 60
  @white 200

  @impl Hal.Emulated
  def start_link(options), do: GenServer.start_link(__MODULE__, Keyword.fetch!(options, :link))

  @impl Hal.Emulated
  def unplug(camera), do: GenServer.call(camera, :unplug)

  @impl Hal.Emulated
  def plug(camera), do: GenServer.call(camera, :plug)

  @impl Hal.Emulated
  def restart(camera), do: GenServer.call(camera, :restart)

  @impl Hal.Emulated
  def noise(camera, bytes), do: GenServer.call(camera, {:noise, bytes})

  @impl Hal.CameraCase
  def show(camera, scene), do: GenServer.call(camera, {:show, scene})

  @impl Hal.CameraCase
  def scene(%Hal.Frame{format: :yuyv, bytes: bytes}) do
    {darkest, brightest} = Enum.min_max(for <<y, _chroma <- bytes>>, do: y)

    cond do
      brightest < @black -> 0
      darkest > @white -> 1
      true -> nil
    end
  end

  @impl GenServer
  def init(link) do
    :timer.send_interval(@period_ms, :picture)
    pictures = %{0 => picture("black"), 1 => picture("white")}
    {:ok, listen(%{link: link, listener: nil, sockets: [], pictures: pictures, scene: 0})}
  end

  defp picture(colour) do
    source = "color=color=#{colour}:size=64x48"
    words = ~w(-v error -f lavfi -i #{source} -frames:v 1 -c:v mjpeg -f mjpeg pipe:1)
    {<<0xFF, 0xD8, rest::binary>>, 0} = System.cmd("ffmpeg", words)

    # Comments make it as large as those of good cameras are: ffmpeg reads so many bytes before it begins, and ffmpeg 7 the most.
    comment = <<0xFF, 0xFE, @comment + 2::16, 0::size(@comment)-unit(8)>>
    <<0xFF, 0xD8>> <> :binary.copy(comment, @comments) <> rest
  end

  @impl GenServer
  def handle_call(:unplug, _from, s), do: {:reply, :ok, close(s)}
  def handle_call(:plug, _from, s), do: {:reply, :ok, listen(s)}
  def handle_call({:show, scene}, _from, s), do: {:reply, :ok, %{s | scene: scene}}

  def handle_call(:restart, _from, s),
    do: {:reply, :ok, s |> say(half(s)) |> close() |> listen()}

  def handle_call({:noise, bytes}, _from, s), do: {:reply, :ok, say(s, [half(s), bytes])}

  @impl GenServer
  def handle_info(:picture, s), do: {:noreply, s |> accept() |> say(s.pictures[s.scene])}

  @impl GenServer
  def terminate(_reason, s), do: close(s)

  defp half(s) do
    picture = s.pictures[s.scene]
    binary_part(picture, 0, div(byte_size(picture), 2))
  end

  defp listen(s) do
    options = [:binary, ifaddr: {:local, s.link}, active: false, send_timeout: @period_ms]
    {:ok, listener} = :gen_tcp.listen(0, options)
    %{s | listener: listener}
  end

  defp accept(%{listener: nil} = s), do: s

  defp accept(s) do
    case :gen_tcp.accept(s.listener, 0) do
      {:ok, socket} -> accept(%{s | sockets: [socket | s.sockets]})
      {:error, :timeout} -> s
    end
  end

  defp say(s, bytes),
    do: %{s | sockets: Enum.filter(s.sockets, &(:gen_tcp.send(&1, bytes) == :ok))}

  defp close(%{listener: nil} = s), do: s

  defp close(s) do
    Enum.each([s.listener | s.sockets], &:gen_tcp.close/1)
    File.rm!(s.link)
    %{s | listener: nil, sockets: []}
  end
end
