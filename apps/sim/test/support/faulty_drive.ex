defmodule Sim.FaultyDrive do
  @moduledoc """
  A drive for `Sim.PlainBase` with one fault, or `nil`: options `port` and `fault`. Limits are 0.5 m/s and 1.0 rad/s.
  """
  @behaviour Hal.Drive
  alias Hal.{Odometry, Pose, Serial, Twist}
  alias Hal.Drive.SlewLimiter

  @stop "v 0.0 0.0\n"

  @impl Hal.Drive
  def init(options) do
    fault = options[:fault]
    unless fault == :lenient, do: Keyword.validate!(options, [:port, :fault])
    words = if fault == :no_words, do: "", else: "\n" <> @stop

    with {:ok, line} <- Serial.open(port: options[:port], last_words: words) do
      Process.send_after(self(), {:tick, line}, 50)
      openings = Process.get(__MODULE__, 0) + 1
      Process.put(__MODULE__, openings)
      opened = %{line: line, fault: fault, rest: "", openings: openings, frame: frame(fault)}
      if fault == :moves, do: drive(Twist.new(0.1, 0), opened), else: drive(Twist.zero(), opened)
    end
  end

  defp frame(:forgets), do: nil
  defp frame(_fault), do: make_ref()

  @impl Hal.Drive
  def drive(twist, %{fault: fault} = state) do
    twist = if SlewLimiter.check(twist) == :ok, do: limit(twist, fault), else: Twist.zero()
    turn = if fault == :mirrored, do: -twist.turn, else: twist.turn

    if fault == :no_stop and Twist.zero?(twist),
      do: {:ok, state},
      else: result(Serial.write(state.line, "v #{twist.linear} #{turn}\n"), state)
  end

  defp result(:ok, state), do: {:ok, state}
  defp result({:error, reason}, state), do: {:error, reason, state}

  defp limit(twist, :fast), do: twist
  defp limit(%{linear: v, turn: w}, _fault), do: Twist.new(clamp(v, 0.5), clamp(w, 1.0))
  defp clamp(value, most), do: value |> max(-most) |> min(most)

  @impl Hal.Drive
  def handle_message({:tick, line}, %{line: line} = state) do
    Process.send_after(self(), {:tick, line}, 50)
    with {:ok, state} <- result(Serial.keep_alive(line), state), do: {:ok, [], state}
  end

  def handle_message(message, %{fault: fault} = state) do
    case Serial.handle(state.line, message) do
      {:data, bytes} -> read(state, bytes)
      {:error, _reason} when fault == :blind -> {:ok, [], state}
      {:error, reason} -> {:error, reason, state}
      :unknown when fault == :picky and message == :junk -> raise "what is junk?"
      :unknown -> {:ok, [], state}
    end
  end

  defp read(%{fault: fault} = state, bytes) do
    {lines, [rest]} = (state.rest <> bytes) |> :binary.split("\n", [:global]) |> Enum.split(-1)
    kept = if fault == :hoards, do: Map.get(state, :kept, []) ++ :binary.bin_to_list(bytes)
    state = Map.merge(state, %{rest: binary_part(rest, 0, min(byte_size(rest), 200)), kept: kept})
    {:ok, Enum.flat_map(lines, &reading(&1, state)), state}
  end

  defp reading("o " <> numbers, state) do
    with [x, y, heading, linear, turn] <- :binary.split(numbers, " ", [:global]),
         [{x, ""}, {y, ""}, {heading, ""}, {linear, ""}, {turn, ""}] <-
           Enum.map([x, y, heading, linear, turn], &Float.parse/1) do
      # As one that counts from zero again, and does not say so.
      shift = if state.frame == nil, do: state.openings, else: 0

      [
        {:odometry,
         %Odometry{
           pose: Pose.new(x + shift, y, heading),
           twist: Twist.new(linear, turn),
           frame: state.frame
         }}
      ]
    else
      _not_a_report -> []
    end
  end

  defp reading(_other, _state), do: []

  @impl Hal.Drive
  def explain(reason, options) do
    if options[:fault] == :wordy,
      do: "oh,\n#{inspect(reason)}",
      else: Serial.explain(reason, options[:port])
  end

  @impl Hal.Drive
  def terminate(state), do: Serial.close(state.line)
end
