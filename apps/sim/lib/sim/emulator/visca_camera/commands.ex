defmodule Sim.Emulator.ViscaCamera.Commands do
  @moduledoc false
  # Carries out the commands of a camera (fact sheet VISCA, section 4). Pure. It checks first whether a command is valid,
  # then whether a socket is free, then whether the command can be carried out now.
  alias Sim.Emulator.ViscaCamera
  alias Sim.Emulator.ViscaCamera.{Head, Packet}

  @fastest {24, 20}
  @presets 0..5

  @typedoc "A valid command: what it does to the camera, and what its socket waits for."
  @type order ::
          {:power, :on | :off}
          | {:zoom, integer()}
          | {:zoom_on, -1 | 0 | 1, pos_integer()}
          | {:go, [{number(), number()}], {pos_integer(), pos_integer()}}
          | {:by, {integer(), integer()}, {pos_integer(), pos_integer()}}
          | {:drive, {integer(), integer()}}
          | {:limit, 0 | 1, {integer(), integer()} | nil}
          | {:memory, :reset | :set | :recall, 0..5}
          | {:focus, :auto | :manual}
          | {:screen, :on | :off | :toggle}

  @doc "The camera after a command (without its first byte, 01), with its pending answers."
  @spec command(ViscaCamera.State.t(), binary(), integer()) :: ViscaCamera.State.t()
  def command(%ViscaCamera.State{} = camera, bytes, at_ms) do
    order = read(bytes)
    socket = ViscaCamera.State.free(camera)

    cond do
      order == :error ->
        ViscaCamera.State.answer(camera, <<0x60, 0x02>>, at_ms)

      socket == nil ->
        ViscaCamera.State.answer(camera, <<0x60, 0x03>>, at_ms)

      not now?(order, camera) ->
        ViscaCamera.State.answer(camera, <<6::4, socket::4, 0x41>>, at_ms)

      true ->
        carry_out(camera, order, socket, at_ms)
    end
  end

  defp now?({:power, _either}, _camera), do: true
  defp now?(_order, %{power: :off}), do: false
  defp now?({:drive, _speeds}, camera), do: not Head.going?(camera.head)
  defp now?(_order, _camera), do: true

  defp carry_out(camera, order, socket, at_ms) do
    {camera, job} = act(order, camera, at_ms)
    ViscaCamera.State.accept(camera, socket, job, at_ms)
  end

  defp act({:power, :on}, %{power: :off, options: options} = camera, at_ms),
    do: {%{camera | power: :on, head: %Head{at_ms: at_ms}}, {:until, at_ms + options.power_on_ms}}

  defp act({:power, :on}, camera, at_ms), do: {camera, {:until, at_ms}}

  defp act({:power, :off}, camera, at_ms),
    do: {%{camera | power: :off, head: Head.stop(camera.head)}, {:until, at_ms}}

  defp act({:zoom, place}, camera, _at_ms),
    do: {head(camera, &Head.zoom(&1, place, camera.options.zoom_ms)), :zoom}

  # The last of seven speeds is the fastest.
  defp act({:zoom_on, way, speed}, camera, at_ms) do
    all_ms = div(camera.options.zoom_ms * 7, speed)
    {head(camera, &Head.zoom_on(&1, way, all_ms)), {:until, at_ms}}
  end

  defp act({:go, places, speeds}, camera, _at_ms),
    do: {head(camera, &Head.go(&1, places, speeds)), :way}

  defp act({:by, {pan, tilt}, speeds}, camera, _at_ms) do
    {head(camera, &Head.go(&1, [{&1.pan + pan, &1.tilt + tilt}], speeds)), :way}
  end

  defp act({:drive, speeds}, camera, at_ms) do
    job = if camera.options.drive_done == :at_once, do: {:until, at_ms}, else: :drive
    {head(camera, &Head.drive(&1, speeds)), job}
  end

  defp act({:limit, corner, place}, camera, at_ms),
    do: {head(camera, &Head.limit(&1, corner, place)), {:until, at_ms}}

  defp act({:memory, :reset, n}, camera, at_ms),
    do: {%{camera | memory: Map.delete(camera.memory, n)}, {:until, at_ms}}

  defp act({:memory, :set, n}, %{head: %{pan: pan, tilt: tilt, zoom: zoom}} = camera, at_ms),
    do: {%{camera | memory: Map.put(camera.memory, n, {pan, tilt, zoom})}, {:until, at_ms}}

  defp act({:memory, :recall, n}, camera, _at_ms) do
    {pan, tilt, zoom} = Map.get(camera.memory, n, {0.0, 0.0, 0.0})

    camera
    |> head(&Head.zoom(&1, zoom, camera.options.zoom_ms))
    |> then(&act({:go, [{pan, tilt}], @fastest}, &1, 0))
  end

  defp act({:focus, focus}, camera, at_ms), do: {%{camera | focus: focus}, {:until, at_ms}}

  defp act({:screen, :toggle}, %{screen: :on} = camera, at_ms),
    do: act({:screen, :off}, camera, at_ms)

  defp act({:screen, :toggle}, camera, at_ms), do: act({:screen, :on}, camera, at_ms)
  defp act({:screen, screen}, camera, at_ms), do: {%{camera | screen: screen}, {:until, at_ms}}

  defp head(camera, change), do: %{camera | head: change.(camera.head)}

  @doc """
  What a command means, or `:error`.

      iex> Sim.Emulator.ViscaCamera.Commands.read(<<0x06, 0x01, 0x06, 0x00, 0x01, 0x03>>)
      {:drive, {-6, 0}}
      iex> Sim.Emulator.ViscaCamera.Commands.read(<<0x06, 0x99>>)
      :error
  """
  @spec read(binary()) :: order() | :error
  def read(<<0x04, 0x00, 0x02>>), do: {:power, :on}
  def read(<<0x04, 0x00, 0x03>>), do: {:power, :off}
  def read(<<0x04, 0x07, 0x00>>), do: {:zoom_on, 0, 4}
  def read(<<0x04, 0x07, 0x02>>), do: {:zoom_on, 1, 4}
  def read(<<0x04, 0x07, 0x03>>), do: {:zoom_on, -1, 4}
  def read(<<0x04, 0x07, 2::4, p::4>>) when p in 2..7, do: {:zoom_on, 1, p}
  def read(<<0x04, 0x07, 3::4, p::4>>) when p in 2..7, do: {:zoom_on, -1, p}

  def read(<<0x04, 0x47, place::binary-size(4)>>) do
    case Packet.number(place) do
      {:ok, zoom} when zoom in 0..0x3FF -> {:zoom, zoom}
      _no_zoom -> :error
    end
  end

  def read(<<0x04, 0x38, 0x02>>), do: {:focus, :auto}
  def read(<<0x04, 0x38, 0x03>>), do: {:focus, :manual}
  def read(<<0x04, 0x3F, 0x00, n>>) when n in @presets, do: {:memory, :reset, n}
  def read(<<0x04, 0x3F, 0x01, n>>) when n in @presets, do: {:memory, :set, n}
  def read(<<0x04, 0x3F, 0x02, n>>) when n in @presets, do: {:memory, :recall, n}

  def read(<<0x06, 0x01, pan_speed, tilt_speed, pan, tilt>>) do
    with {:ok, pan} <- axis(pan, {2, 1}, pan_speed, 24),
         {:ok, tilt} <- axis(tilt, {1, 2}, tilt_speed, 20),
         do: {:drive, {pan, tilt}}
  end

  def read(<<0x06, 0x02, rest::binary>>), do: way(rest, &{:go, [&1], &2})
  def read(<<0x06, 0x03, rest::binary>>), do: way(rest, &{:by, &1, &2})
  def read(<<0x06, 0x04>>), do: {:go, [{0, 0}], @fastest}
  # To both stops, and back.
  def read(<<0x06, 0x05>>), do: {:go, [{-880, -300}, {880, 300}, {0, 0}], @fastest}
  def read(<<0x06, 0x06, 0x02>>), do: {:screen, :on}
  def read(<<0x06, 0x06, 0x03>>), do: {:screen, :off}
  def read(<<0x06, 0x06, 0x10>>), do: {:screen, :toggle}

  def read(<<0x06, 0x07, 0x00, corner, place::binary-size(8)>>) when corner in 0..1 do
    with {:ok, place} <- place(place), do: {:limit, corner, place}
  end

  def read(<<0x06, 0x07, 0x01, corner, 0x07, 0x0F, 0x0F, 0x0F, 0x07, 0x0F, 0x0F, 0x0F>>)
      when corner in 0..1,
      do: {:limit, corner, nil}

  def read(_nonsense), do: :error

  # Its speed does not matter to an axis that stands.
  defp axis(3, _ways, _speed, _most), do: {:ok, 0}
  defp axis(way, {way, _back}, speed, most) when speed in 1..most//1, do: {:ok, speed}
  defp axis(way, {_on, way}, speed, most) when speed in 1..most//1, do: {:ok, -speed}
  defp axis(_way, _ways, _speed, _most), do: :error

  defp way(<<pan_speed, tilt_speed, place::binary-size(8)>>, order)
       when pan_speed in 1..24 and tilt_speed in 1..20 do
    with {:ok, place} <- place(place), do: order.(place, {pan_speed, tilt_speed})
  end

  defp way(_nonsense, _order), do: :error

  defp place(<<pan::binary-size(4), tilt::binary-size(4)>>) do
    with {:ok, pan} <- Packet.number(pan),
         {:ok, tilt} <- Packet.number(tilt),
         do: {:ok, {pan, tilt}}
  end
end
