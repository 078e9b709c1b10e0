defmodule Swarm.Comms.Joystick do
  @moduledoc """
  Takes a base's own joystick (`:joystick` of `Hal.Drive`) for the words of a person who drives, as those of a gamepad are. Pure;
  milliseconds by the robot's clock.

  Its button is the dead man's switch: while it is held, each look at the joystick is a word that lasts for 300 ms from when the
  joystick was heard, and when it is let go the last word is to stand. A joystick that falls silent says nothing more, so the last word
  ends by itself; and a button that was down before it was heard, or through a silence, counts only when it was let go. What is
  within a tenth of the middle is the middle.
  """
  alias Hal.Drive.SlewLimiter
  alias Hal.Twist

  @word_ms 300
  # As with other pads, half a metre a second and a radian a second are the hand's own limits; the robot has others.
  @speed 0.5
  @turn 1.0
  @dead_zone 0.1

  defstruct button: nil, refused: nil

  @typedoc """
  The button is `:up`, `:pressed`, or `:spent`: down, but of no use before it was seen up; `nil` before it was heard.
  `refused` is why the robot did not obey last, and whether that was told, since the button was pressed.
  """
  @type t :: %__MODULE__{
          button: nil | :up | :pressed | :spent,
          refused: {line :: String.t(), :heard | :told} | nil
        }
  @type heard :: {%{twist: Twist.t(), held?: boolean()}, heard_ms :: integer()}
  @type word :: {:move, linear :: float(), turn :: float(), for_s :: float()}

  @doc "How long a word lasts from when the joystick was heard, ms."
  @spec word_ms() :: pos_integer()
  def word_ms, do: @word_ms

  @doc """
  What a person says by what was heard of the joystick last, `nil` for nothing.

      iex> alias Swarm.Comms.Joystick
      iex> up = %{twist: Hal.Twist.zero(), held?: false}
      iex> {nil, joystick} = Joystick.word(%Joystick{}, {up, 0}, 10)
      iex> {word, joystick} = Joystick.word(joystick, {%{twist: Hal.Twist.new(0.24, 0.02), held?: true}, 100}, 110)
      iex> word
      {:move, 0.24, 0.0, 0.29}
      iex> {word, _joystick} = Joystick.word(joystick, {up, 200}, 200)
      iex> word
      {:move, 0.0, 0.0, 0.3}
  """
  @spec word(t(), heard() | nil, at_ms :: integer()) :: {word() | nil, t()}
  def word(joystick, heard, at_ms) do
    case {fresh(heard, at_ms), joystick.button} do
      {nil, :pressed} ->
        {nil, %{joystick | button: :spent}}

      {nil, _button} ->
        {nil, joystick}

      {{_twist, false, for_s}, :pressed} ->
        {{:move, 0.0, 0.0, for_s}, %__MODULE__{button: :up}}

      {{_twist, false, _for_s}, _button} ->
        {nil, %__MODULE__{button: :up}}

      {{twist, true, for_s}, button} when button in [:up, :pressed] ->
        pressed(joystick, twist, for_s)

      {{_twist, true, _for_s}, _unseen} ->
        {nil, %{joystick | button: :spent}}
    end
  end

  defp pressed(joystick, %Twist{linear: linear, turn: turn}, for_s) do
    word = {:move, hand(linear, @speed), hand(turn, @turn), for_s}
    {word, %{joystick | button: :pressed}}
  end

  # What is no speed was not heard.
  defp fresh({%{twist: %Twist{} = twist, held?: held?}, heard_ms}, at_ms)
       when is_boolean(held?) and at_ms - heard_ms < @word_ms do
    if SlewLimiter.check(twist) == :ok,
      do: {twist, held?, min(@word_ms - (at_ms - heard_ms), @word_ms) / 1_000}
  end

  defp fresh(_silent, _at_ms), do: nil

  defp hand(value, most) when abs(value) < @dead_zone * most, do: 0.0
  defp hand(value, most), do: value |> max(-most) |> min(most)

  @doc """
  Whether a refusal is news: it is told once while the button is held, when it comes a second time, because the first word of a hand
  may be refused for want of a person who is there (`presence:`), as whom it counts from then on. The button must be let go then: one that
  is held through an emergency stop does not drive after the reset.

      iex> alias Swarm.Comms.Joystick
      iex> {false, joystick} = Joystick.refused(%Joystick{button: :pressed}, "mag1 is not armed")
      iex> {true, joystick} = Joystick.refused(joystick, "mag1 is not armed")
      iex> {Joystick.refused(joystick, "mag1 is not armed") |> elem(0), joystick.button}
      {false, :spent}
  """
  @spec refused(t(), String.t()) :: {news? :: boolean(), t()}
  def refused(%__MODULE__{refused: {line, :heard}} = joystick, line),
    do: {true, %{joystick | refused: {line, :told}, button: :spent}}

  def refused(%__MODULE__{refused: {line, :told}} = joystick, line), do: {false, joystick}
  def refused(joystick, line), do: {false, %{joystick | refused: {line, :heard}}}
end
