defmodule Sim.Emulator.ViscaCamera.Inquiries do
  @moduledoc "Answers the inquiries to a camera (fact sheet VISCA, section 4). Pure."
  alias Sim.Emulator.ViscaCamera
  alias Sim.Emulator.ViscaCamera.{Head, Packet}

  @doc """
  The data of an answer, or the code of an error: 2 for an unknown inquiry, 0x41 while it is
  switched off.
  """
  @spec ask(ViscaCamera.State.t(), binary()) :: {:ok, binary()} | {:error, 0x02 | 0x41}
  # Vendor, model, release of the firmware, sockets.
  def ask(_camera, <<0x00, 0x02>>), do: {:ok, <<0x00, 0x20, 0x04, 0x02, 0x01, 0x00, 0x02>>}
  def ask(camera, <<0x04, 0x00>>), do: {:ok, flag(camera.power == :on)}
  def ask(%{power: :on, head: head} = camera, what), do: asked(what, head, camera)

  def ask(camera, what) do
    with {:ok, _bytes} <- asked(what, camera.head, camera), do: {:error, 0x41}
  end

  defp asked(<<0x04, 0x47>>, head, _camera), do: {:ok, Packet.nibbles(round(head.zoom))}
  defp asked(<<0x04, 0x38>>, _head, camera), do: {:ok, flag(camera.focus == :auto)}

  defp asked(<<0x06, 0x12>>, head, _camera),
    do: {:ok, Packet.nibbles(round(head.pan)) <> Packet.nibbles(round(head.tilt))}

  defp asked(<<0x06, 0x11>>, _head, _camera), do: {:ok, <<0x18, 0x14>>}

  # The meaning of the bits is unknown; one tells whether the head is moving to a position.
  defp asked(<<0x06, 0x10>>, head, _camera),
    do: {:ok, if(Head.going?(head), do: <<0x04, 0x00>>, else: <<0x00, 0x00>>)}

  defp asked(<<0x06, 0x06>>, _head, camera), do: {:ok, flag(camera.screen == :on)}
  defp asked(<<0x06, 0x23>>, _head, _camera), do: {:ok, <<0x01>>}
  defp asked(_nonsense, _head, _camera), do: {:error, 0x02}

  defp flag(true), do: <<0x02>>
  defp flag(false), do: <<0x03>>
end
