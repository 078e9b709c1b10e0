defmodule Hal.RPLidar.Session do
  @moduledoc """
  Decides what is said to an RPLIDAR and when, and makes scans of what it answers. Pure; times in ms.

  It is stopped, asked who it is and how it does, its motor is started, and it is told to scan. One that says that it has a fault is
  reset once. One that does not know the express scan is told the plain one. The errors: `{:no_answer, :info | :health | :scan}`,
  `{:fault, code}`, `:silent` (nothing was measured for 3 s).
  """
  @behaviour Hal.Lidar.Session
  alias Hal.Lidar.{Session, Turn}
  alias Hal.RPLidar
  alias Hal.RPLidar.Nodes

  @stopped_ms 100
  @answer_ms 1_000
  @reset_ms 2_000
  @motor_ms 20
  # It takes two seconds to gather speed.
  @silent_ms 3_000
  @rays 360
  # Of a turn that does not end: ten times what the fastest one measures.
  @most 40_000

  @enforce_keys [:state, :due_ms, :mode, :sign]
  defstruct @enforce_keys ++ [buffer: <<>>, reset?: false, nodes: nil, turn: nil, count: 0]

  @type t :: %__MODULE__{}

  @impl Session
  def new(options, at_ms) do
    mode = Keyword.get(options, :mode, :express)
    sign = if options[:upside_down], do: 1.0, else: -1.0
    stopping(%__MODULE__{state: nil, due_ms: at_ms, mode: mode, sign: sign}, at_ms)
  end

  @impl Session
  def stop(_options), do: RPLidar.request(:stop) <> RPLidar.request({:motor, false})

  @impl Session
  def wake_ms(%__MODULE__{due_ms: due_ms}), do: due_ms

  @impl Session
  def tick(%__MODULE__{due_ms: due_ms} = s, at_ms) when at_ms < due_ms, do: {[], s}
  def tick(%__MODULE__{state: :stopping} = s, at_ms), do: ask(s, :info, at_ms)
  def tick(%__MODULE__{state: :resetting} = s, at_ms), do: stopping(s, at_ms)
  def tick(%__MODULE__{state: :motor, mode: :express} = s, at_ms), do: ask(s, :express, at_ms)
  def tick(%__MODULE__{state: :motor} = s, at_ms), do: ask(s, :scan, at_ms)

  def tick(%__MODULE__{state: {:asked, :express}} = s, at_ms),
    do: told({:odd, "it knows no express scan, and is told a plain one"}, ask(s, :scan, at_ms))

  def tick(%__MODULE__{state: {:asked, what}} = s, _at_ms),
    do: {[{:error, {:no_answer, what}}], s}

  def tick(%__MODULE__{state: :scanning} = s, _at_ms), do: {[{:error, :silent}], s}

  @impl Session
  # What it still says of a scan, or at its start.
  def bytes(%__MODULE__{state: state} = s, _bytes, _at_ms)
      when state in [:stopping, :resetting, :motor],
      do: {[], s}

  def bytes(%__MODULE__{state: {:asked, what}} = s, bytes, at_ms) do
    case RPLidar.answer(s.buffer <> bytes) do
      {:more, begun} -> {[], %{s | buffer: begun}}
      {:ok, type, size, rest} -> answered(s, what, {type, size, rest}, at_ms)
    end
  end

  def bytes(%__MODULE__{state: :scanning} = s, bytes, at_ms) do
    case Nodes.take(s.nodes, bytes) do
      {[], nodes} -> {[], %{s | nodes: nodes}}
      {measured, nodes} -> gather(measured, %{s | nodes: nodes, due_ms: at_ms + @silent_ms}, [])
    end
  end

  defp answered(s, :info, {0x04, 20, <<_info::binary-size(20), _::binary>>}, at_ms),
    do: ask(s, :health, at_ms)

  defp answered(s, :health, {0x06, 3, <<health, code::16-little, _::binary>>}, at_ms),
    do: health(s, health, code, at_ms)

  defp answered(s, what, {type, _size, rest}, at_ms) when what in [:scan, :express] do
    if type in Nodes.types() do
      s = %{s | state: :scanning, nodes: Nodes.new(type), turn: nil, buffer: <<>>}
      bytes(%{s | due_ms: at_ms + @silent_ms}, rest, at_ms)
    else
      {[], %{s | buffer: rest}}
    end
  end

  # Its data are not whole yet, or it is another answer.
  defp answered(s, what, {type, size, rest}, _at_ms) do
    whole? = byte_size(rest) >= size
    expected? = {what, type} in [info: 0x04, health: 0x06]

    if whole? or not expected?,
      do: {[], %{s | buffer: rest}},
      else: {[], %{s | buffer: again(type, size, rest)}}
  end

  defp again(type, size, rest), do: <<0xA5, 0x5A, size::32-little, type, rest::binary>>

  defp health(s, 2, code, at_ms) do
    if s.reset?,
      do: {[{:error, {:fault, code}}], s},
      else:
        {[{:write, RPLidar.request(:reset)}],
         %{s | state: :resetting, reset?: true, due_ms: at_ms + @reset_ms}}
  end

  defp health(s, 1, code, at_ms),
    do: told({:odd, "it warns of a fault, code #{code}"}, motor(s, at_ms))

  defp health(s, _good, _code, at_ms), do: motor(s, at_ms)

  defp motor(s, at_ms) do
    {[{:write, RPLidar.request({:motor, true})}], %{s | state: :motor, due_ms: at_ms + @motor_ms}}
  end

  defp stopping(s, at_ms) do
    {[{:write, RPLidar.request(:stop)}], %{s | state: :stopping, due_ms: at_ms + @stopped_ms}}
  end

  defp ask(s, what, at_ms) do
    {[{:write, RPLidar.request(what)}],
     %{s | state: {:asked, what}, buffer: <<>>, due_ms: at_ms + @answer_ms}}
  end

  defp told(effect, {effects, s}), do: {[effect | effects], s}

  # Before the first mark a turn is not whole.
  defp gather([{true, _angle, _mm} = first | rest], %{turn: turn} = s, done) do
    done = if turn in [nil, []], do: done, else: [{:scan, Turn.scan(turn, @rays)} | done]
    gather(rest, add(%{s | turn: [], count: 0}, first), done)
  end

  defp gather([_measured | rest], %{turn: nil} = s, done), do: gather(rest, s, done)

  defp gather([_measured | rest], %{count: count} = s, done) when count >= @most,
    do: gather(rest, %{s | turn: nil}, done)

  defp gather([measured | rest], s, done), do: gather(rest, add(s, measured), done)
  defp gather([], s, done), do: {Enum.reverse(done), s}

  # Seen from above it turns clockwise.
  defp add(s, {_first?, angle, mm}) do
    direction = s.sign * angle * :math.pi() / (180 * 64)
    %{s | turn: [{direction, mm} | s.turn], count: s.count + 1}
  end
end
