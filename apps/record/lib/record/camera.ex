defmodule Record.Camera do
  @moduledoc """
  Makes JPEG pictures of frames for a recording, one after another, with an ffmpeg that belongs to
  the calling process (`Vision.Jpeg.Encoder`), which must trap exits. It waits for each picture: a run
  in lockstep has no clock that would go on meanwhile, and the same run gives the same pictures.
  """
  alias Hal.Frame
  alias Vision.Jpeg.Encoder

  # On an overloaded machine ffmpeg is slow and not stuck.
  @late_ms 10_000

  @typedoc "An ffmpeg for frames of one shape, or none yet."
  @type t :: Encoder.t() | nil

  @doc "Whether pictures can be made; the error is one line."
  @spec able() :: :ok | {:error, line :: String.t()}
  def able, do: if(Encoder.find(), do: :ok, else: {:error, Encoder.explain(:no_ffmpeg)})

  @doc "The JPEG of a frame. After an error there is no camera any more: the next frame starts one."
  @spec jpeg(t(), Frame.t()) :: {{:ok, binary()} | {:error, line :: String.t()}, t()}
  def jpeg(camera, %Frame{} = frame) do
    with {:ok, camera} <- fit(camera, Encoder.shape(frame)),
         :ok <- Encoder.encode(camera, frame) do
      wait(camera)
    else
      {:error, reason} -> failed(camera, reason)
    end
  end

  defp fit(%Encoder{shape: shape} = camera, shape), do: {:ok, camera}

  defp fit(camera, shape) do
    :ok = close(camera)
    Encoder.open(shape)
  end

  defp wait(%Encoder{port: port} = camera) do
    receive do
      {^port, _said} = message -> said(camera, message)
      {:EXIT, ^port, _reason} = message -> said(camera, message)
    after
      @late_ms -> failed(camera, :late)
    end
  end

  defp said(camera, message) do
    case Encoder.handle(message, camera) do
      {:picture, jpeg, camera} -> {{:ok, jpeg}, camera}
      {:more, camera} -> wait(camera)
      {:error, reason} -> failed(camera, reason)
    end
  end

  defp failed(camera, reason) do
    :ok = close(camera)
    {{:error, Encoder.explain(reason)}, nil}
  end

  @doc "Ends its ffmpeg, if there is one."
  @spec close(t()) :: :ok
  def close(nil), do: :ok
  def close(%Encoder{} = camera), do: Encoder.close(camera)
end
