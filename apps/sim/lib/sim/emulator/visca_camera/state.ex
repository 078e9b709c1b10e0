defmodule Sim.Emulator.ViscaCamera.State do
  @moduledoc false
  # Holds the state of a camera: its head, its two sockets, and its pending answers. Pure; times in milliseconds.
  #
  # A socket is free (`nil`) or holds what its command waits for: `:way`, `:zoom`, `:drive` or `{:until, at_ms}`.
  alias Sim.Noise
  alias Sim.Emulator.ViscaCamera.{Head, Packet}

  @enforce_keys [:options, :at_ms, :head, :power]
  defstruct @enforce_keys ++
              [
                sockets: %{1 => nil, 2 => nil},
                buffer: <<>>,
                out: [],
                answered: 0,
                focus: :auto,
                screen: :off,
                memory: %{},
                wished: nil
              ]

  @type t :: %__MODULE__{}
  @type job :: :way | :zoom | :drive | {:until, integer()}

  @doc "A camera that was just switched on."
  @spec boot(map(), integer()) :: t()
  def boot(options, at_ms) do
    %__MODULE__{
      options: options,
      at_ms: at_ms,
      head: %Head{at_ms: at_ms},
      power: options.power
    }
  end

  @doc "Adds an answer, which is sent after the latency."
  @spec answer(t(), binary(), integer()) :: t()
  def answer(camera, bytes, at_ms), do: say(camera, Packet.answer(bytes), at_ms)

  @doc "The same with the whole packet given."
  @spec say(t(), binary(), integer()) :: t()
  def say(%__MODULE__{options: options, answered: n} = camera, packet, at_ms) do
    camera = %{camera | answered: n + 1}
    lost? = Noise.unit(Noise.hash(options.seed, n, 0, 0x715C)) < options.drop

    if lost?,
      do: camera,
      else: %{camera | out: camera.out ++ [{at_ms + options.latency_ms, packet}]}
  end

  @doc "The answers that are due by now."
  @spec due(t(), integer()) :: {iodata(), t()}
  def due(%__MODULE__{out: out} = camera, at_ms) do
    {now, later} = Enum.split_while(out, fn {due_ms, _packet} -> due_ms <= at_ms end)
    {for({_due_ms, packet} <- now, do: packet), %{camera | out: later}}
  end

  @doc "When the next answer is due, or a job that only waits is done."
  @spec next_ms(t()) :: integer() | nil
  def next_ms(%__MODULE__{out: out, sockets: sockets}) do
    answers = for {due_ms, _packet} <- Enum.take(out, 1), do: due_ms
    jobs = for {_socket, {:until, at_ms}} <- sockets, do: at_ms
    Enum.min(answers ++ jobs, fn -> nil end)
  end

  @doc "The first free socket, or `nil`."
  @spec free(t()) :: 1 | 2 | nil
  def free(%__MODULE__{sockets: sockets}), do: Enum.find([1, 2], &(sockets[&1] == nil))

  @doc "Takes a command: its socket is acknowledged, and completed when the job is done."
  @spec accept(t(), 1 | 2, job(), integer()) :: t()
  def accept(camera, socket, job, at_ms) do
    camera = answer(camera, <<4::4, socket::4>>, at_ms)
    settle(%{camera | sockets: Map.put(camera.sockets, socket, job)}, at_ms)
  end

  @doc "The camera at a later time, with what was done by then completed."
  @spec settle(t(), integer()) :: t()
  def settle(%__MODULE__{} = camera, at_ms) do
    camera = %{camera | head: Head.advance(camera.head, at_ms), at_ms: at_ms}

    for {socket, job} <- Enum.sort(camera.sockets), done?(job, camera), reduce: camera do
      camera ->
        answer(
          %{camera | sockets: Map.put(camera.sockets, socket, nil)},
          <<5::4, socket::4>>,
          at_ms
        )
    end
  end

  defp done?(nil, _camera), do: false
  defp done?(:way, camera), do: not Head.going?(camera.head)
  defp done?(:zoom, camera), do: camera.head.zooming == :still
  defp done?(:drive, camera), do: camera.head.motion == :still
  defp done?({:until, until_ms}, camera), do: camera.at_ms >= until_ms

  @doc "Cancels the job of a socket; what moves for it stops."
  @spec cancel(t(), integer(), integer()) :: t()
  def cancel(%__MODULE__{sockets: sockets} = camera, socket, at_ms) do
    case sockets do
      %{^socket => job} when job != nil ->
        camera = %{camera | sockets: Map.put(sockets, socket, nil), head: stop(camera.head, job)}
        answer(camera, <<6::4, socket::4, 0x04>>, at_ms)

      _idle_or_none ->
        answer(camera, <<6::4, socket::4, 0x05>>, at_ms)
    end
  end

  defp stop(head, :zoom), do: Head.zoom_on(head, 0, 1)
  defp stop(head, job) when job in [:way, :drive], do: Head.stop(head)
  defp stop(head, _waits), do: head

  @doc "Clears both sockets and the pending answers."
  @spec clear(t()) :: t()
  def clear(%__MODULE__{} = camera),
    do: %{camera | sockets: %{1 => nil, 2 => nil}, out: [], head: Head.stop(camera.head)}
end
