defmodule Sim.Emulator.ViscaCamera do
  @moduledoc """
  Emulates a Sony EVI-D30 at the other end of the serial line, written from the fact sheet alone. Pure: bytes and time
  in, bytes and direction of view out; `Sim.Emulator` runs it on a pseudo-terminal, and the camera of a body in a
  simulated world looks where it looks. Its options are those of `Sim.Emulator.ViscaCamera.Options`.

  Two commands are carried out at a time. Where the sheet leaves it open: the answer that a
  command cannot be executed names the socket that the command would have had; a second move
  replaces the first, and both are completed when it ends; a broadcast clear stops the head.
  """
  @behaviour Sim.Emulator.Core
  import Sim.Emulator.ViscaCamera.State, only: [answer: 3, settle: 2]
  alias Sim.Emulator.ViscaCamera
  alias Sim.Emulator.ViscaCamera.{Commands, Head, Options, Packet}

  # How often a command to the body is repeated.
  @repeat_ms 100
  # While it turns, the body follows in steps of this size.
  @step_ms 50

  @type t :: ViscaCamera.State.t()

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options),
         do: {:ok, ViscaCamera.State.boot(options, at_ms)}
  end

  @doc "Its power went off and on: it looks straight ahead, and announces itself to the chain."
  @impl Sim.Emulator.Core
  def restart(%ViscaCamera.State{} = camera, at_ms) do
    fresh = %{ViscaCamera.State.boot(camera.options, at_ms) | answered: camera.answered}
    if camera.options.announce, do: answer(fresh, <<0x38>>, at_ms), else: fresh
  end

  @impl Sim.Emulator.Core
  def hear(%ViscaCamera.State{} = camera, bytes, at_ms) do
    {packets, rest} = Packet.cut(camera.buffer <> bytes)
    camera = settle(%{camera | buffer: rest}, at_ms)
    Enum.reduce(packets, camera, &understand(&2, &1, at_ms))
  end

  defp understand(camera, :other, _at_ms), do: camera
  defp understand(camera, :long, at_ms), do: answer(camera, <<0x60, 0x01>>, at_ms)

  defp understand(camera, {:to_all, <<0x30, 0x01>>}, at_ms),
    do: ViscaCamera.State.say(camera, <<0x88, 0x30, 0x02, 0xFF>>, at_ms)

  defp understand(camera, {:to_all, <<0x01, 0x00, 0x01>>}, at_ms),
    do:
      camera
      |> ViscaCamera.State.clear()
      |> ViscaCamera.State.say(<<0x88, 0x01, 0x00, 0x01, 0xFF>>, at_ms)

  defp understand(camera, {:to_all, _other}, _at_ms), do: camera

  defp understand(camera, {:to_me, <<0x01, 0x00, 0x01>>}, at_ms),
    do: camera |> ViscaCamera.State.clear() |> answer(<<0x50>>, at_ms)

  defp understand(camera, {:to_me, <<0x09, what::binary>>}, at_ms) do
    case ask(camera, what) do
      {:ok, bytes} -> answer(camera, <<0x50, bytes::binary>>, at_ms)
      {:error, code} -> answer(camera, <<0x60, code>>, at_ms)
    end
  end

  defp understand(camera, {:to_me, <<2::4, socket::4>>}, at_ms),
    do: ViscaCamera.State.cancel(camera, socket, at_ms)

  defp understand(camera, {:to_me, <<0x01, what::binary>>}, at_ms),
    do: Commands.command(camera, what, at_ms)

  defp understand(camera, {:to_me, _nonsense}, at_ms), do: answer(camera, <<0x60, 0x02>>, at_ms)

  @doc "It gets no input but the commands."
  @impl Sim.Emulator.Core
  def feel(%ViscaCamera.State{} = camera, _reading, _at_ms), do: camera

  @impl Sim.Emulator.Core
  def run(%ViscaCamera.State{} = camera, at_ms) do
    {bytes, camera} = camera |> settle(at_ms) |> ViscaCamera.State.due(at_ms)
    {pan, tilt} = Head.angles(camera.head)
    wishes = [{:look, pan, tilt}, {:zoom, Head.field_of_view(camera.head, camera.options.lens)}]

    case camera.wished do
      {^wishes, since_ms} when at_ms - since_ms < @repeat_ms -> {bytes, [], camera}
      _other_or_long_ago -> {bytes, wishes, %{camera | wished: {wishes, at_ms}}}
    end
  end

  @impl Sim.Emulator.Core
  def next_ms(%ViscaCamera.State{head: head} = camera) do
    turning = if head.motion != :still or head.zooming != :still, do: camera.at_ms + @step_ms

    [ViscaCamera.State.next_ms(camera), Head.there_ms(head), Head.zoomed_ms(head), turning]
    |> Enum.reject(&is_nil/1)
    |> Enum.min(fn -> nil end)
  end

  # Answers the inquiries to a camera (fact sheet VISCA, section 4). Pure.

  # The data of an answer, or the code of an error: 2 for an unknown inquiry, 0x41 while it is
  # switched off.
  # Vendor, model, release of the firmware, sockets.
  defp ask(_camera, <<0x00, 0x02>>), do: {:ok, <<0x00, 0x20, 0x04, 0x02, 0x01, 0x00, 0x02>>}
  defp ask(camera, <<0x04, 0x00>>), do: {:ok, flag(camera.power == :on)}
  defp ask(%{power: :on, head: head} = camera, what), do: asked(what, head, camera)

  defp ask(camera, what) do
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
