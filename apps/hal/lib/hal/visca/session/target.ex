defmodule Hal.Visca.Session.Target do
  @moduledoc false
  # Decides where a camera's head should look, and whether to send the command (again). Pure; the camera's
  # units.
  #
  # A new target is due at once. A target that was sent is due again when the head has stood still
  # for 0.5 s, more than a degree away from it, and 1 s has passed since it was last sent.
  alias Hal.Visca.Model

  @still_ms 500
  @again_ms 1_000

  @enforce_keys [:off]
  defstruct @enforce_keys ++
              [wanted: nil, said: nil, said_ms: nil, at: nil, since_ms: nil, now_ms: nil]

  @type position :: {pan :: integer(), tilt :: integer()}
  @typedoc """
  `at` is the position of the head, which has been there since `since_ms` and was last seen at
  `now_ms`; `off` is a degree of pan and of tilt.
  """
  @type t :: %__MODULE__{
          off: {pos_integer(), pos_integer()},
          wanted: position() | nil,
          said: position() | nil,
          said_ms: integer() | nil,
          at: position() | nil,
          since_ms: integer() | nil,
          now_ms: integer() | nil
        }

  @doc "No target yet for a camera of this model."
  @spec new(Model.t()) :: t()
  def new(model \\ Model.get(:d30)),
    do: %__MODULE__{off: {ceil(model.pan_degree), ceil(model.tilt_degree)}}

  @doc "Sets the target."
  @spec want(t(), position()) :: t()
  def want(%__MODULE__{} = target, position), do: %{target | wanted: position}

  @doc "The camera has lost the target that was sent."
  @spec forget(t()) :: t()
  def forget(%__MODULE__{} = target), do: %{target | said: nil, said_ms: nil}

  @doc "Takes the position of the head."
  @spec seen(t(), position(), integer()) :: t()
  def seen(%__MODULE__{at: {pan, tilt}, since_ms: since_ms} = target, {p, t} = at, now_ms)
      when abs(p - pan) <= 1 and abs(t - tilt) <= 1,
      do: %{target | at: at, since_ms: since_ms, now_ms: now_ms}

  def seen(%__MODULE__{} = target, at, now_ms),
    do: %{target | at: at, since_ms: now_ms, now_ms: now_ms}

  @doc """
  The target to send now; `nil` if there is nothing to send.

      iex> alias Hal.Visca.Session.Target
      iex> {{-264, 0}, target} = Target.due(Target.want(Target.new(), {-264, 0}), 0)
      iex> Target.due(target, 100)
      nil
  """
  @spec due(t(), integer()) :: {position(), t()} | nil
  def due(%__MODULE__{wanted: wanted} = target, now_ms) do
    if wanted != nil and (wanted != target.said or astray?(target, now_ms)),
      do: {wanted, %{target | said: wanted, said_ms: now_ms}}
  end

  defp astray?(%{at: nil}, _now_ms), do: false

  defp astray?(%{at: {pan, tilt}, wanted: {p, t}, off: {pan_off, tilt_off}} = target, now_ms) do
    (abs(pan - p) > pan_off or abs(tilt - t) > tilt_off) and
      target.now_ms - target.since_ms >= @still_ms and now_ms - target.said_ms >= @again_ms
  end
end
