defmodule Console.Teleop.Joystick do
  @moduledoc false
  # Reads a gamepad as Linux tells of it (`/dev/input/js0`): events of eight bytes, little-endian: the time in ms (32
  # bits), the value (signed, 16 bits), the type (8 bits: 1 a button, 2 an axis, with 128 added for how things were when
  # it was opened), and the number of button or axis (8 bits). Pure: each function is given the time. Source: Linux's
  # joystick API, `Documentation/input/joydev/joystick-api.rst`.
  #
  # A robot is driven only while a shoulder button (4 or 5) is held: that is the dead man's switch of a gamepad. The left stick
  # (axes 0 and 1) says where to; what is within a tenth of its middle is the middle.
  #
  # A wireless gamepad that is out of reach leaves its receiver, and so its device, in place: it only falls silent, and the
  # release of the button is never told. So silence ends driving. Linux tells changes only, and a hand that holds still says
  # nothing: any event within a second keeps it alive, be it another button. What repeats values that have not changed, at
  # a steady rate, would go on doing so, and may be silent for 0.3 s only. A button that was let go unseen may also be down
  # again, or still, when the gamepad is back: only one that was seen up since then is pressed.
  import Bitwise, only: [band: 2]

  @dead_zone 0.1
  @shoulders [4, 5]
  @button 1
  @axis 2
  @at_opening 0x80

  @changes_ms 1_000
  @rate_ms 300
  # So many values that are not new, none of them late, are a rate.
  @rate 3

  defstruct values: %{}, shoulders: %{}, rest: "", heard_ms: nil, repeats: 0, why: nil

  @typedoc """
  `values` are those of all buttons and axes, as told. A shoulder button is `:up`, `:pressed`, or `:spent`: down, but of
  no use before it was seen up. `why` says what has spent it.
  """
  @type t :: %__MODULE__{
          values: %{{type :: 1 | 2, number :: byte()} => integer()},
          shoulders: %{(4 | 5) => :up | :pressed | :spent},
          rest: binary(),
          heard_ms: integer() | nil,
          repeats: non_neg_integer(),
          why: nil | :silent | :not_seen_up
        }

  @doc """
  Takes bytes of the device, in pieces of any size, heard at that time.

      iex> bytes = <<0::32, 0::16, 0x81, 4, 0::32, 1::little-16, 1, 4, 0::32, -32_767::little-signed-16, 2, 1, 0::32>>
      iex> pad = Console.Teleop.Joystick.take(%Console.Teleop.Joystick{}, bytes, 0)
      iex> {Console.Teleop.Joystick.stick(pad, 1_000), Console.Teleop.Joystick.stick(pad, 1_001)}
      {{1.0, 0.0}, nil}
  """
  @spec take(t(), binary(), integer()) :: t()
  def take(%__MODULE__{} = pad, bytes, now_ms) do
    pad = pass(pad, now_ms)
    events(%{pad | rest: ""}, pad.rest <> bytes, now_ms)
  end

  defp events(pad, <<_ms::32, value::little-signed-16, type, number, more::binary>>, now_ms),
    do:
      pad
      |> event({band(type, 0x7F), number}, value, band(type, @at_opening) != 0, now_ms)
      |> events(more, now_ms)

  defp events(pad, less, _now_ms), do: %{pad | rest: less}

  defp event(pad, {type, _number} = id, value, opening?, now_ms) when type in [@button, @axis] do
    same? = not opening? and pad.values[id] == value
    pad = if same?, do: repeated(pad, now_ms), else: pad
    pad = %{pad | values: Map.put(pad.values, id, value), heard_ms: now_ms}
    shoulder(pad, id, value, opening?)
  end

  defp event(pad, _id, _value, _opening?, _now_ms), do: pad

  # What has a rate keeps it.
  defp repeated(%{repeats: @rate} = pad, _now_ms), do: pad
  defp repeated(pad, now_ms) when now_ms - pad.heard_ms > @rate_ms, do: %{pad | repeats: 0}
  defp repeated(pad, _now_ms), do: %{pad | repeats: pad.repeats + 1}

  defp shoulder(pad, {@button, number}, value, opening?) when number in @shoulders do
    case {value, pad.shoulders[number]} do
      {0, _any} -> press(pad, number, :up)
      {_down, :up} when not opening? -> press(pad, number, :pressed)
      {_down, :pressed} when not opening? -> pad
      {_down, :spent} -> pad
      _never_seen_up -> %{press(pad, number, :spent) | why: :not_seen_up}
    end
  end

  defp shoulder(pad, _id, _value, _opening?), do: pad

  defp press(pad, number, state) do
    pad = put_in(pad.shoulders[number], state)
    if state == :pressed or not held?(pad, :spent), do: %{pad | why: nil}, else: pad
  end

  @doc "What the gamepad is worth at that time, if nothing more was heard."
  @spec pass(t(), integer()) :: t()
  def pass(pad, now_ms) do
    if held?(pad, :pressed) and now_ms - pad.heard_ms > silence_ms(pad) do
      spent =
        Map.new(pad.shoulders, fn {n, was} -> {n, if(was == :pressed, do: :spent, else: was)} end)

      %{pad | shoulders: spent, why: :silent}
    else
      pad
    end
  end

  @doc "How long it may say nothing while a robot is driven, in ms."
  @spec silence_ms(t()) :: pos_integer()
  def silence_ms(%__MODULE__{repeats: @rate}), do: @rate_ms
  def silence_ms(%__MODULE__{}), do: @changes_ms

  defp held?(pad, state), do: Enum.any?(pad.shoulders, &match?({_number, ^state}, &1))

  @doc "Where the hand wants to go at that time; `nil` while no shoulder button is held that counts."
  @spec stick(t(), integer()) :: Console.Teleop.stick() | nil
  def stick(%__MODULE__{} = pad, now_ms) do
    pad = pass(pad, now_ms)
    if held?(pad, :pressed), do: {-middle(pad, 1), -middle(pad, 0)}
  end

  defp middle(%{values: values}, number) do
    case max(Map.get(values, {@axis, number}, 0) / 32_767, -1.0) do
      near when abs(near) < @dead_zone -> -0.0
      value -> value
    end
  end
end
