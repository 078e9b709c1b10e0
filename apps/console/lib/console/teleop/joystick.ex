defmodule Console.Teleop.Joystick do
  @moduledoc false
  # Reads a gamepad as Linux tells of it (`/dev/input/js0`): events of eight bytes, little-endian: the time in ms (32
  # bits), the value (signed, 16 bits), the type (8 bits: 1 a button, 2 an axis, with 128 added for how things were when
  # it was opened), and the number of button or axis (8 bits). Pure. Source: Linux's joystick API,
  # `Documentation/input/joydev/joystick-api.rst`.
  #
  # A robot is driven only while a shoulder button (4 or 5) is held: that is the dead man's switch of a gamepad. The left stick
  # (axes 0 and 1) says where to; what is within a tenth of its middle is the middle.
  import Bitwise, only: [band: 2]

  @dead_zone 0.1
  @shoulders [4, 5]
  @button 1
  @axis 2

  defstruct axes: %{}, held: [], rest: ""

  @typedoc "`axes` 0 and 1 are from -1 to 1, right and back positive; `held` are the shoulder buttons that are down."
  @type t :: %__MODULE__{
          axes: %{(0 | 1) => float()},
          held: [non_neg_integer()],
          rest: binary()
        }

  @doc """
  Takes bytes of the device, in pieces of any size.

      iex> bytes = <<0::32, 1::little-16, 1, 4, 0::32, -32_767::little-signed-16, 2, 1, 0::32>>
      iex> Console.Teleop.Joystick.stick(Console.Teleop.Joystick.take(%Console.Teleop.Joystick{}, bytes))
      {1.0, 0.0}
  """
  @spec take(t(), binary()) :: t()
  def take(%__MODULE__{rest: rest} = pad, bytes), do: events(%{pad | rest: ""}, rest <> bytes)

  defp events(
         pad,
         <<_ms::32, value::little-signed-16, type, number, more::binary>>
       ),
       do: pad |> event(band(type, 0x7F), number, value) |> events(more)

  defp events(pad, less), do: %{pad | rest: less}

  defp event(pad, @axis, number, value) when number in [0, 1],
    do: put_in(pad.axes[number], max(value / 32_767, -1.0))

  defp event(pad, @button, number, 1) when number in @shoulders,
    do: %{pad | held: Enum.uniq([number | pad.held])}

  defp event(pad, @button, number, 0), do: %{pad | held: List.delete(pad.held, number)}
  defp event(pad, _type, _number, _value), do: pad

  @doc "Where the hand wants to go; `nil` while no shoulder button is held."
  @spec stick(t()) :: Console.Teleop.stick() | nil
  def stick(%__MODULE__{held: []}), do: nil
  def stick(%__MODULE__{axes: axes}), do: {-middle(axes[1]), -middle(axes[0])}

  defp middle(value) when value == nil or abs(value) < @dead_zone, do: -0.0
  defp middle(value), do: value
end
