defmodule Hal.Lds.Session do
  @moduledoc """
  Starts an LDS-01, listens to an LDS-02, which turns as soon as it has power, and makes scans of their packets. Pure; times in
  ms. The error `:silent`: no packet for 3 s.
  """
  @behaviour Hal.Lidar.Session
  alias Hal.Lds
  alias Hal.Lidar.{Session, Turn}

  @silent_ms 3_000
  @rays 360
  # A turn of which so few measurements came is not told.
  @least 180
  @most 4_000

  @enforce_keys [:model, :sign, :due_ms]
  defstruct @enforce_keys ++ [buffer: <<>>, last: nil, turn: [], count: 0, whole?: false]

  @type t :: %__MODULE__{}

  @impl Session
  def new(options, at_ms) do
    sign = if options[:upside_down], do: 1.0, else: -1.0
    s = %__MODULE__{model: options[:model], sign: sign, due_ms: at_ms + @silent_ms}
    {if(options[:model] == :lds01, do: [{:write, "b"}], else: []), s}
  end

  @impl Session
  def stop(options), do: if(options[:model] == :lds01, do: "e", else: <<>>)

  @impl Session
  def wake_ms(%__MODULE__{due_ms: due_ms}), do: due_ms

  @impl Session
  def tick(%__MODULE__{due_ms: due_ms} = s, at_ms) when at_ms < due_ms, do: {[], s}
  def tick(%__MODULE__{} = s, _at_ms), do: {[{:error, :silent}], s}

  @impl Session
  def bytes(%__MODULE__{} = s, bytes, at_ms) do
    case Lds.cut(s.model, s.buffer <> bytes) do
      {[], rest} -> {[], %{s | buffer: rest}}
      {packets, rest} -> gather(packets, %{s | buffer: rest, due_ms: at_ms + @silent_ms}, [])
    end
  end

  # A turn ends where the angles begin again; the first one was not heard from its beginning.
  defp gather([[{angle, _mm} | _] = packet | rest], s, done) do
    if (s.last != nil and angle < s.last) or s.count > @most do
      told? = s.whole? and s.count in @least..@most
      done = if told?, do: [{:scan, Turn.scan(s.turn, @rays)} | done], else: done
      s = %{s | turn: [], count: 0, whole?: s.count <= @most}
      gather(rest, add(s, packet), done)
    else
      gather(rest, add(s, packet), done)
    end
  end

  defp gather([], s, done), do: {Enum.reverse(done), s}

  defp add(s, [{angle, _mm} | _] = packet) do
    turn =
      for {degrees, mm} <- packet, reduce: s.turn do
        turn -> [{s.sign * degrees * :math.pi() / 180, mm} | turn]
      end

    %{s | turn: turn, count: s.count + length(packet), last: angle}
  end
end
