defmodule Console.Gamepad do
  @moduledoc false
  # Drives a robot by a gamepad: ten words a second while a shoulder button is held and the gamepad is heard
  # (`Console.Teleop.Joystick`), one word to stand when it is let go, falls silent or is gone.
  #
  # Debian's `cat` reads the device, so that no thread of the VM waits in it. What is heard is not held up by a robot that does
  # not answer: words wait elsewhere (`Console.Orders`).
  use GenServer, restart: :temporary
  alias Console.Orders
  alias Console.Teleop.Joystick

  @word_ms 100

  @type option ::
          {:module, module()}
          | {:live, term()}
          | {:robot, atom()}
          | {:path, Path.t()}
          | {:tell, (line :: String.t() -> term())}

  @doc """
  Starts it for a fleet (`module` and `live` as in `Console.Live`); `tell` gets lines for people: that the robot refuses, that the
  gamepad is gone. The error says in one line why the device cannot be read. It is linked to the caller and ends with it.
  """
  @spec start_link([option()]) :: {:ok, pid()} | {:error, line :: String.t()}
  def start_link(options) do
    options = Map.new(options)

    with :ok <- readable(options.path), do: GenServer.start_link(__MODULE__, options)
  end

  defp readable(path) do
    case File.stat(path) do
      {:ok, %{type: type, access: access}}
      when type in [:device, :other] and access in [:read, :read_write] ->
        :ok

      {:ok, %{type: type}} when type in [:device, :other] ->
        {:error, "#{path} cannot be read: whoever drives must be in the group input"}

      {:ok, _file_or_folder} ->
        {:error, "#{path} is no gamepad; /dev/input/js0 is the first"}

      {:error, reason} ->
        {:error, "no gamepad at #{path} (#{:file.format_error(reason)})"}
    end
  end

  @impl GenServer
  def init(options) do
    cat = System.find_executable("cat")
    port = Port.open({:spawn_executable, cat}, [:binary, :exit_status, args: [options.path]])
    me = self()
    {:ok, orders} = Orders.start_link("gamepad of #{node()}", &send(me, {:answered, &1, &2}))
    own = %{port: port, orders: orders, pad: %Joystick{}, driving?: false, refused: nil}
    {:ok, Map.merge(options, own)}
  end

  @impl GenServer
  def handle_info({port, {:data, bytes}}, %{port: port} = s) do
    now_ms = Hal.Clock.now_ms()
    s = put_pad(s, Joystick.take(s.pad, bytes, now_ms))
    idle? = s.driving? or Joystick.stick(s.pad, now_ms) == nil
    {:noreply, if(idle?, do: s, else: word(s))}
  end

  def handle_info({port, {:exit_status, _status}}, %{port: port} = s) do
    s = if s.driving?, do: word(%{s | pad: %Joystick{}}), else: s
    :ok = Orders.settle(s.orders)
    s.tell.("the gamepad at #{s.path} is gone; it drives #{s.robot} no more")
    {:stop, :normal, s}
  end

  def handle_info(:word, s), do: {:noreply, word(s)}

  # Once, not ten times a second.
  def handle_info({:answered, _word, {:error, line}}, s) do
    if line != s.refused, do: s.tell.(line)
    {:noreply, %{s | refused: line}}
  end

  # The first without a hand is the word to stand.
  defp word(s) do
    now_ms = Hal.Clock.now_ms()
    s = put_pad(s, Joystick.pass(s.pad, now_ms))
    stick = Joystick.stick(s.pad, now_ms)
    if stick, do: Process.send_after(self(), :word, @word_ms)
    source = {s.module, s.live}
    now_us = System.monotonic_time(:microsecond)
    if stick, do: Orders.give(s.orders, Orders.of_presence(now_us))
    Orders.give(s.orders, Orders.of_word(s.robot, stick || {0.0, 0.0}, :gamepad, source, now_us))
    %{s | driving?: stick != nil, refused: if(s.driving?, do: s.refused)}
  end

  # A person is told once why the robot does not go although the button is held.
  defp put_pad(s, pad) do
    if pad.why not in [nil, s.pad.why], do: s.tell.(why(pad, s))
    %{s | pad: pad}
  end

  defp why(%{why: :silent} = pad, s) do
    "#{s.robot} stands: the gamepad said nothing for #{Joystick.silence_ms(pad) / 1_000} s. Let go of the shoulder button and " <>
      "press it again; a gamepad tells changes only, so move its stick or press any button once a second"
  end

  defp why(%{why: :not_seen_up}, s),
    do:
      "#{s.robot} stands: the shoulder button was down before the gamepad was heard. Let go of it, and press it again"
end
