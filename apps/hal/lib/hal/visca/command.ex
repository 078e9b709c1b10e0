defmodule Hal.Visca.Command do
  @moduledoc """
  Commands to a VISCA camera, in the camera's own units, and their bytes (fact sheet, sections 2
  and 4). Pure; `Hal.Visca.Units` converts radians to these numbers. The ranges are the widest of
  the models (`Hal.Visca.Model`).

  | command | meaning |
  |---|---|
  | `:address_set` | to all: take the numbers 1 to 7 in the order of the cable |
  | `:if_clear` / `:if_clear_one` | to all / to one: forget commands and sockets |
  | `{:cancel, socket}` | end the command in that socket |
  | `{:power, on?}` | |
  | `{:look, pan, tilt, pan_speed, tilt_speed}` | absolute; speeds 1 to 24 and 1 to 20 |
  | `{:step, pan, tilt, pan_speed, tilt_speed}` | relative |
  | `{:drive, {:left, n}, {:up, n}}` | until the next command; also `:right`, `:down`, `{:stop, 0}` |
  | `:home`, `:reset` | to 0, 0; find the mechanical stops again, then 0, 0 |
  | `{:zoom, :tele}` | also `:wide`, `:stop`; `{:zoom, :tele, 2..7}` with a speed |
  | `{:zoom_to, 0..0x4000}` | |
  | `{:focus, :auto}`, `:manual` | |
  | `{:limit, :up_right, pan, tilt}` | also `:down_left`; `{:limit_clear, corner}` |
  | `{:screen, :on}` | the camera's own text in the picture; `:off`, `:toggle` |
  | `{:memory, :set, 0..5}` | also `:reset`, `:recall` |
  | `{:ask, inquiry}` | see `t:inquiry/0`; `Hal.Visca.Reply.value/2` reads the answer |
  """

  @type corner :: :up_right | :down_left
  @type inquiry ::
          :version
          | :power
          | :zoom
          | :position
          | :max_speed
          | :status
          | :screen
          | :video
          | :focus
  @type t ::
          :address_set
          | :if_clear
          | :if_clear_one
          | {:cancel, 1..2}
          | {:power, boolean()}
          | {:look | :step, integer(), integer(), 1..24, 1..20}
          | {:drive, {:left | :right, 1..24} | {:stop, 0}, {:up | :down, 1..20} | {:stop, 0}}
          | :home
          | :reset
          | {:zoom, :tele | :wide | :stop}
          | {:zoom, :tele | :wide, 2..7}
          | {:zoom_to, 0..0x4000}
          | {:focus, :auto | :manual}
          | {:limit, corner(), integer(), integer()}
          | {:limit_clear, corner()}
          | {:screen, :on | :off | :toggle}
          | {:memory, :reset | :set | :recall, 0..5}
          | {:ask, inquiry()}

  defguardp pan?(n) when n in -2267..2267
  defguardp tilt?(n) when n in -400..1200

  @doc """
  The bytes of a command to camera 1 to 7. An unknown command raises `ArgumentError`.

      iex> Hal.Visca.Command.encode({:look, -264, -120, 24, 20}, 1)
      <<0x81, 0x01, 0x06, 0x02, 0x18, 0x14, 0x0F, 0x0E, 0x0F, 0x08, 0x0F, 0x0F, 0x08, 0x08, 0xFF>>
      iex> Hal.Visca.Command.encode(:address_set, 1)
      <<0x88, 0x30, 0x01, 0xFF>>
  """
  @spec encode(t(), camera :: 1..7) :: binary()
  def encode(command, _camera) when command in [:address_set, :if_clear],
    do: <<0x88, payload(command)::binary, 0xFF>>

  def encode(command, camera) when camera in 1..7,
    do: <<0x80 + camera, payload(command)::binary, 0xFF>>

  @doc "Whether a command is answered directly, without taking a socket."
  @spec immediate?(t()) :: boolean()
  def immediate?({kind, _}) when kind in [:ask, :cancel], do: true
  def immediate?(command), do: command in [:address_set, :if_clear, :if_clear_one]

  @spec payload(t()) :: binary()
  defp payload(:address_set), do: <<0x30, 0x01>>
  defp payload(c) when c in [:if_clear, :if_clear_one], do: <<0x01, 0x00, 0x01>>
  defp payload({:cancel, socket}) when socket in 1..2, do: <<0x20 + socket>>
  defp payload({:power, true}), do: <<0x01, 0x04, 0x00, 0x02>>
  defp payload({:power, false}), do: <<0x01, 0x04, 0x00, 0x03>>
  defp payload({:zoom, :stop}), do: <<0x01, 0x04, 0x07, 0x00>>
  defp payload({:zoom, :tele}), do: <<0x01, 0x04, 0x07, 0x02>>
  defp payload({:zoom, :wide}), do: <<0x01, 0x04, 0x07, 0x03>>
  defp payload({:zoom, :tele, p}) when p in 2..7, do: <<0x01, 0x04, 0x07, 0x20 + p>>
  defp payload({:zoom, :wide, p}) when p in 2..7, do: <<0x01, 0x04, 0x07, 0x30 + p>>
  defp payload({:zoom_to, z}) when z in 0..0x4000, do: <<0x01, 0x04, 0x47, nibbles(z)::binary>>
  defp payload({:focus, :auto}), do: <<0x01, 0x04, 0x38, 0x02>>
  defp payload({:focus, :manual}), do: <<0x01, 0x04, 0x38, 0x03>>
  defp payload(:home), do: <<0x01, 0x06, 0x04>>
  defp payload(:reset), do: <<0x01, 0x06, 0x05>>

  defp payload({:look, pan, tilt, v, w})
       when pan?(pan) and tilt?(tilt) and v in 1..24 and w in 1..20,
       do: <<0x01, 0x06, 0x02, v, w, nibbles(pan)::binary, nibbles(tilt)::binary>>

  # From one end to the other is twice the range.
  defp payload({:step, pan, tilt, v, w})
       when pan in -4534..4534 and tilt in -1600..1600 and v in 1..24 and w in 1..20,
       do: <<0x01, 0x06, 0x03, v, w, nibbles(pan)::binary, nibbles(tilt)::binary>>

  defp payload({:drive, {pan, v}, {tilt, w}} = command) do
    case {pan_direction(pan, v), tilt_direction(tilt, w)} do
      {d, t} when d != nil and t != nil -> <<0x01, 0x06, 0x01, v, w, d, t>>
      _ -> refuse!(command)
    end
  end

  defp payload({:limit, corner, pan, tilt})
       when corner in [:up_right, :down_left] and pan?(pan) and tilt?(tilt),
       do: <<0x01, 0x06, 0x07, 0x00, corner(corner), nibbles(pan)::binary, nibbles(tilt)::binary>>

  defp payload({:limit_clear, corner}) when corner in [:up_right, :down_left],
    do:
      <<0x01, 0x06, 0x07, 0x01, corner(corner), nibbles(0x7FFF)::binary, nibbles(0x7FFF)::binary>>

  defp payload({:screen, :on}), do: <<0x01, 0x06, 0x06, 0x02>>
  defp payload({:screen, :off}), do: <<0x01, 0x06, 0x06, 0x03>>
  defp payload({:screen, :toggle}), do: <<0x01, 0x06, 0x06, 0x10>>
  defp payload({:memory, :reset, p}) when p in 0..5, do: <<0x01, 0x04, 0x3F, 0x00, p>>
  defp payload({:memory, :set, p}) when p in 0..5, do: <<0x01, 0x04, 0x3F, 0x01, p>>
  defp payload({:memory, :recall, p}) when p in 0..5, do: <<0x01, 0x04, 0x3F, 0x02, p>>
  defp payload({:ask, :version}), do: <<0x09, 0x00, 0x02>>
  defp payload({:ask, :power}), do: <<0x09, 0x04, 0x00>>
  defp payload({:ask, :zoom}), do: <<0x09, 0x04, 0x47>>
  defp payload({:ask, :focus}), do: <<0x09, 0x04, 0x38>>
  defp payload({:ask, :screen}), do: <<0x09, 0x06, 0x06>>
  defp payload({:ask, :status}), do: <<0x09, 0x06, 0x10>>
  defp payload({:ask, :max_speed}), do: <<0x09, 0x06, 0x11>>
  defp payload({:ask, :position}), do: <<0x09, 0x06, 0x12>>
  defp payload({:ask, :video}), do: <<0x09, 0x06, 0x23>>
  defp payload(other), do: refuse!(other)

  # 16 bits as four bytes of one nibble each, so that no payload contains an 0xFF.
  defp nibbles(n) do
    <<a::4, b::4, c::4, d::4>> = <<n::16>>
    <<a, b, c, d>>
  end

  defp pan_direction(:left, v) when v in 1..24, do: 1
  defp pan_direction(:right, v) when v in 1..24, do: 2
  defp pan_direction(:stop, 0), do: 3
  defp pan_direction(_direction, _v), do: nil

  defp tilt_direction(:up, w) when w in 1..20, do: 1
  defp tilt_direction(:down, w) when w in 1..20, do: 2
  defp tilt_direction(:stop, 0), do: 3
  defp tilt_direction(_direction, _w), do: nil

  defp corner(:up_right), do: 1
  defp corner(:down_left), do: 0

  @spec refuse!(term()) :: no_return()
  defp refuse!(other) do
    raise ArgumentError,
          "no VISCA command: #{inspect(other)} (Hal.Visca.Command lists them and their ranges)"
  end
end
