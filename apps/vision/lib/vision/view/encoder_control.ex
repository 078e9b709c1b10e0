defmodule Vision.View.EncoderControl do
  @moduledoc false
  # Encodes frames as pictures, one at a time, with an encoder that runs only while it is needed: it
  # is started for the first frame, for frames of another shape, and after a failure; it is closed
  # after 5 s without a picture.
  #
  # After an encoder has ended, or has needed more than 5 s for a picture, there is a pause of
  # 100 ms, 200 ms, … up to 5 s. The owner must trap exits and pass all messages to `handle/3`.
  # Times are integer milliseconds.
  alias Hal.{Event, Frame}
  alias Vision.Jpeg.Encoder
  alias Vision.View.Picture

  @rest_ms 100
  @longest_rest_ms 5_000
  # On an overloaded machine the encoder, which has a lower priority, is slow and not stuck.
  @late_ms 5_000
  @idle_ms 5_000

  @enforce_keys [:ffmpeg]
  defstruct @enforce_keys ++
              [
                encoder: nil,
                job: nil,
                rest_ms: @rest_ms,
                rests_until: nil,
                made: 0,
                failed: 0,
                why: nil
              ]

  @type t :: %__MODULE__{
          ffmpeg: Path.t() | nil,
          encoder: Encoder.t() | nil,
          job: {reference(), Frame.t()} | nil,
          rest_ms: pos_integer(),
          rests_until: integer() | nil,
          made: non_neg_integer(),
          failed: non_neg_integer(),
          why: String.t() | nil
        }

  @doc "The state before the first picture. `ffmpeg` is its path, and `nil` looks for it."
  @spec new(Path.t() | nil) :: t()
  def new(ffmpeg), do: %__MODULE__{ffmpeg: ffmpeg}

  @doc "Whether ffmpeg is available."
  @spec able(t()) :: :ok | {:error, line :: String.t()}
  def able(%__MODULE__{ffmpeg: ffmpeg}),
    do: if(ffmpeg || Encoder.find(), do: :ok, else: {:error, Encoder.explain(:no_ffmpeg)})

  @doc "How long the pause still lasts, in milliseconds; `:busy` while a picture is being made."
  @spec rests(t(), now_ms :: integer()) :: non_neg_integer() | :busy
  def rests(%__MODULE__{job: job}, _now_ms) when job != nil, do: :busy
  def rests(%__MODULE__{rests_until: nil}, _now_ms), do: 0
  def rests(%__MODULE__{rests_until: until}, now_ms), do: max(0, until - now_ms)

  @doc "Starts to make a picture of a frame. Only when there is no pause."
  @spec begin(t(), Frame.t(), now_ms :: integer()) :: {:ok, t()} | {:error, String.t(), t()}
  def begin(%__MODULE__{job: nil} = maker, frame, now_ms) do
    with {:ok, encoder} <- fit(maker, Encoder.shape(frame)),
         maker = %{maker | encoder: encoder},
         :ok <- Encoder.encode(encoder, frame) do
      ref = make_ref()
      Process.send_after(self(), {__MODULE__, :late, ref}, @late_ms)
      # Without the frame's bytes, which are not needed any more.
      {:ok, %{maker | job: {ref, %{frame | bytes: <<>>}}}}
    else
      {:error, reason} -> fail(maker, reason, now_ms)
    end
  end

  defp fit(%{encoder: %{shape: shape} = encoder}, shape), do: {:ok, encoder}

  defp fit(maker, shape) do
    _closed = close(maker)
    Encoder.open(shape, maker.ffmpeg)
  end

  @doc "Handles a message; `:unknown` if it is not for this module."
  @spec handle(t(), term(), now_ms :: integer()) ::
          {:picture, Picture.t(), t()} | {:ok, t()} | {:error, String.t(), t()} | :unknown
  def handle(%__MODULE__{job: {ref, _frame}} = maker, {__MODULE__, :late, ref}, now_ms),
    do: fail(maker, :late, now_ms)

  def handle(%__MODULE__{job: nil, made: made} = maker, {__MODULE__, :idle, made}, _now_ms),
    do: {:ok, close(maker)}

  def handle(maker, {__MODULE__, _clock, _another_picture}, _now_ms), do: {:ok, maker}
  def handle(%__MODULE__{encoder: nil}, _message, _now_ms), do: :unknown

  def handle(%__MODULE__{encoder: encoder} = maker, message, now_ms) do
    case Encoder.handle(message, encoder) do
      {:picture, jpeg, encoder} -> made(%{maker | encoder: encoder}, jpeg, now_ms)
      {:more, encoder} -> {:ok, %{maker | encoder: encoder}}
      {:error, reason} -> fail(maker, reason, now_ms)
      :unknown -> :unknown
    end
  end

  # A picture without a frame: this ffmpeg does not do what it should.
  defp made(%{job: nil} = maker, _jpeg, now_ms), do: fail(maker, :unreadable, now_ms)

  defp made(%{job: {_ref, frame}} = maker, jpeg, now_ms) do
    made = maker.made + 1
    Process.send_after(self(), {__MODULE__, :idle, made}, @idle_ms)

    if maker.rests_until,
      do: Event.execute([:vision, :view, :healed], %{at_ms: now_ms}, %{view: self()})

    maker = %{maker | made: made, job: nil, rest_ms: @rest_ms, rests_until: nil}
    about = Map.take(frame, [:width, :height, :at_ms])
    {:picture, struct!(Picture, Map.put(about, :jpeg, jpeg)), maker}
  end

  defp fail(maker, reason, now_ms) do
    line = Encoder.explain(reason)
    about = %{view: self(), reason: reason, line: line}
    Event.execute([:vision, :view, :failed], %{at_ms: now_ms}, about)

    maker = %{
      close(maker)
      | failed: maker.failed + 1,
        why: line,
        rests_until: now_ms + maker.rest_ms,
        rest_ms: min(2 * maker.rest_ms, @longest_rest_ms)
    }

    {:error, line, maker}
  end

  @doc "Closes the encoder, if there is one; the next frame starts another."
  @spec close(t()) :: t()
  def close(%__MODULE__{encoder: nil} = maker), do: %{maker | job: nil}

  def close(maker) do
    Encoder.close(maker.encoder)
    %{maker | encoder: nil, job: nil}
  end
end
