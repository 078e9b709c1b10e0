defmodule Hal.FaultyCamera do
  @moduledoc "`Hal.Camera.FFmpeg` with one fault, or `nil`: options `source` and `fault`. For `Hal.NetworkCamera`."
  @behaviour Hal.Camera
  alias Hal.Camera.FFmpeg

  @ask_ms 50
  @kept 10

  @impl Hal.Camera
  def init(options) do
    fault = options[:fault]
    unless fault == :lenient, do: Keyword.validate!(options, [:source, :fault])
    size = if fault == :small, do: {32, 24}

    with {:ok, camera} <- FFmpeg.init(source: options[:source], unsafe: true, size: size) do
      if fault == :pushes, do: :timer.send_interval(@ask_ms, :ask)
      if fault == :leaves, do: Port.open({:spawn_executable, "/bin/sleep"}, args: ["20"])
      {:ok, %{camera: camera, fault: fault, first: nil, count: 0, kept: []}}
    end
  end

  @impl Hal.Camera
  def next(%{fault: :pushes} = state), do: {:ok, state}
  def next(state), do: state.camera |> FFmpeg.next() |> wrap(state)

  defp wrap({:ok, camera}, state), do: {:ok, %{state | camera: camera}}

  @impl Hal.Camera
  def handle_message(:ask, %{fault: :pushes} = state) do
    with {:ok, state} <- state.camera |> FFmpeg.next() |> wrap(state), do: {:ok, [], state}
  end

  def handle_message(:junk, %{fault: :picky}), do: raise("what is junk?")

  def handle_message(message, state) do
    case FFmpeg.handle_message(message, state.camera) do
      {:ok, [{:frame, frame}], camera} -> picture(frame, %{state | camera: camera})
      {:ok, readings, camera} -> {:ok, readings, %{state | camera: camera}}
      {:error, _reason, camera} when state.fault == :deaf -> {:ok, [], %{state | camera: camera}}
      {:error, reason, camera} -> {:error, reason, %{state | camera: camera}}
    end
  end

  # Gives the picture of before so many others.
  defp picture(frame, %{fault: :queues} = state) do
    case Enum.split(state.kept, @kept - 1) do
      {newer, [oldest]} ->
        {:ok, [{:frame, oldest}], %{state | kept: [frame | newer]}}

      {kept, []} ->
        with {:ok, state} <- next(%{state | kept: [frame | kept]}), do: {:ok, [], state}
    end
  end

  defp picture(frame, %{fault: :hoards} = state) do
    {:ok, [{:frame, frame}], %{state | kept: [:binary.copy(frame.bytes, 50) | state.kept]}}
  end

  defp picture(frame, state) do
    state = %{state | first: state.first || frame, count: state.count + 1}
    {:ok, [{:frame, spoilt(frame, state.fault, state)}], state}
  end

  defp spoilt(frame, :short, _state), do: %{frame | bytes: binary_part(frame.bytes, 0, 10)}
  defp spoilt(frame, :late, _state), do: %{frame | at_ms: frame.at_ms - 10_000}
  defp spoilt(frame, :back, %{count: count}), do: %{frame | at_ms: frame.at_ms - 150 * count}
  defp spoilt(frame, :stands, %{first: first}), do: %{frame | at_ms: first.at_ms}
  defp spoilt(frame, :blind, %{first: first}), do: %{frame | bytes: first.bytes}
  defp spoilt(frame, _fault, _state), do: frame

  @impl Hal.Camera
  def explain(reason, options) do
    if options[:fault] == :wordy,
      do: "oh,\n#{inspect(reason)}",
      else: FFmpeg.explain(reason, options)
  end

  @impl Hal.Camera
  def terminate(state), do: FFmpeg.terminate(state.camera)
end
