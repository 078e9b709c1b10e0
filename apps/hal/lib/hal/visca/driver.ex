defmodule Hal.Visca.Driver do
  @moduledoc """
  Drives the pan-tilt-zoom unit of a Sony EVI-D30, D31, D70 or D100 (`Hal.Visca.Model`) on a serial line, run by
  `Hal.Device`.

      {Hal.Device, kind: :ptz, driver: {Hal.Visca.Driver, port: "/dev/ttyS2"}, sinks: [...]}

  Options: `Hal.Visca.Options`. `Hal.Visca.Session`, which is pure, decides what to do and when;
  this module only owns the line and the clock.

  ## What the line allows

  9600 baud is 960 bytes a second, 1.04 ms each; the camera answers after about 16 ms.

  | | bytes to and from | on the line | with the answer's delay |
  |---|---|---|---|
  | absolute target and its ACK | 15 + 3 | 18.8 ms | 35 ms |
  | position | 5 + 11 | 16.7 ms | 33 ms |
  | zoom | 5 + 7 | 12.5 ms | 29 ms |
  | completion | 3 | 3.1 ms | |

  So ten times a second a target (35 ms), a position (33 ms) and the completion (3 ms) take 71 of
  100 ms; the zoom inquiry every half second adds 6 of 100 on average, and 29 at one time. 10 Hz
  is what the line allows while the camera tracks; with a slower camera both become fewer, and
  nothing queues.

  ## Readings

  `{:ptz, %{pan:, tilt:, field_of_view:, age_ms:}}` as in `Hal.Ptz`, one for each position; and what
  the camera refuses or has done (`:look`, `:zoom`, `:switch_on`).

  ## Errors

  Those of `Hal.Serial`, at the opening and later, and those of `Hal.Visca.Session`. After each of
  them the device closes the line and opens it again.
  """
  @behaviour Hal.Ptz
  alias Hal.Serial
  alias Hal.Visca.{Model, Options, Session}

  @enforce_keys [:line, :head]
  defstruct @enforce_keys ++ [timer: nil, wake: nil]

  @opaque t :: %__MODULE__{
            line: Serial.t(),
            head: Session.t(),
            timer: reference() | nil,
            wake: reference() | nil
          }

  @doc "Checks the options; see `Hal.Visca.Options.check/1`."
  @spec options(keyword()) :: {:ok, keyword()} | {:error, String.t()}
  defdelegate options(options), to: Options, as: :check

  @impl Hal.Ptz
  defdelegate option_table, to: Options, as: :table

  @impl Hal.Ptz
  def init(options) do
    case Options.check(options) do
      {:ok, options} ->
        with {:ok, line} <- Serial.open(Options.serial(options)), do: open(line, options)

      {:error, line} ->
        raise ArgumentError, line
    end
  end

  @doc """
  Describes an error in words.

      iex> Hal.Visca.Driver.explain({:model, 0x0411}, port: "/dev/ttyS2")
      "/dev/ttyS2: expected EVI-D30, EVI-D70 or EVI-D100, got a camera FCB-EX780 (0x0411); model: in the robot file overrides this"
  """
  @impl Hal.Ptz
  def explain(reason, options), do: "#{options[:port]}: #{words(reason, options)}"

  defp words(:no_answer, _options), do: "no camera answers"
  defp words(:mute, _options), do: "the camera does not say where it looks"

  defp words({:cameras, n}, options),
    do: "camera #{number(options)} is not there; its cable has #{n}"

  defp words({:address, n}, options),
    do: "camera #{n} answers, and camera #{number(options)} does not (camera: in the robot file)"

  defp words({:model, nil}, _options),
    do: "the camera refuses to say its model; model: in the robot file names it"

  defp words({:model, code}, _options) do
    "expected #{allowed()}, got a camera #{Model.words(code)}; model: in the robot file overrides this"
  end

  defp words({:zoom, zoom, key}, _options) do
    model = Model.get(key)

    "the camera says that its zoom is #{Model.hex(zoom)}, and that of an #{model.name} ends at " <>
      "#{Model.hex(model.zoom)} (is it another model, or its digital zoom on?)"
  end

  defp words({:position, pan, tilt, key}, _options) do
    "the camera says that it is at pan #{pan}, tilt #{tilt}, where an #{Model.get(key).name} cannot be (is it " <>
      "another model?)"
  end

  defp words({:opening, step, refusal}, _options),
    do: "the camera answers, but #{stuck(step)}#{if refusal, do: " (#{refusal})"}"

  defp words(reason, options) do
    port = "#{options[:port]}"
    reason |> Serial.explain(port) |> String.replace_prefix(port <> ": ", "")
  end

  defp stuck(:switch_on), do: "does not switch on"
  defp stuck(:power), do: "does not say whether it is on"
  defp stuck(:version), do: "does not say its model"
  defp stuck(_look_round), do: "does not say where it looks"

  defp number(options), do: options[:camera] || 1

  defp allowed do
    {names, [last]} = Model.keys() |> Enum.map(&Model.get(&1).name) |> Enum.split(-1)
    Enum.join(names, ", ") <> " or " <> last
  end

  @impl Hal.Ptz
  def reach(state), do: Session.reach(state.head)

  @impl Hal.Ptz
  def look(pan, tilt, state),
    do: outward(Session.look(state.head, pan, tilt, Hal.Clock.now_ms()), state)

  @impl Hal.Ptz
  def zoom(field_of_view, state),
    do: outward(Session.zoom(state.head, field_of_view, Hal.Clock.now_ms()), state)

  @impl Hal.Ptz
  def handle_message({:visca_wake, wake}, %__MODULE__{wake: wake} = state),
    do: carry_out(Session.tick(state.head, Hal.Clock.now_ms()), state)

  def handle_message({:visca_wake, _old}, state), do: {:ok, [], state}

  def handle_message(message, %__MODULE__{} = state) do
    case Serial.handle(state.line, message) do
      {:data, bytes} -> carry_out(Session.bytes(state.head, bytes, Hal.Clock.now_ms()), state)
      {:error, reason} -> {:error, reason, state}
      :unknown -> {:ok, [], state}
    end
  end

  @impl Hal.Ptz
  def terminate(%__MODULE__{} = state) do
    cancel(state)
    Serial.close(state.line)
  end

  defp open(line, options) do
    {effects, head} =
      Session.open(
        Keyword.take(options, [:camera, :model, :lens, :poll_ms, :field_of_view]),
        Hal.Clock.now_ms()
      )

    case carry_out({effects, head}, %__MODULE__{line: line, head: head}) do
      {:ok, [], state} ->
        {:ok, state}

      {:error, reason, state} ->
        terminate(state)
        {:error, reason}
    end
  end

  # A request gives no readings.
  defp outward(result, state) do
    with {:ok, [], state} <- carry_out(result, state), do: {:ok, state}
  end

  defp carry_out({effects, head}, state) do
    {readings, error} = Enum.reduce(effects, {[], nil}, &effect(&1, &2, state.line))
    state = wake(%{state | head: head})
    if error, do: {:error, error, state}, else: {:ok, Enum.reverse(readings), state}
  end

  defp effect(_effect, {readings, error}, _line) when error != nil, do: {readings, error}
  defp effect({:reading, reading}, {readings, nil}, _line), do: {[reading | readings], nil}
  defp effect({:error, reason}, {readings, nil}, _line), do: {readings, reason}

  defp effect({:write, bytes}, {readings, nil}, line) do
    case Serial.write(line, bytes) do
      :ok -> {readings, nil}
      # It was not written; the session notices that no answer comes.
      {:error, :overrun} -> {readings, nil}
      {:error, reason} -> {readings, reason}
    end
  end

  defp wake(state) do
    cancel(state)

    case Session.wake_ms(state.head) do
      nil ->
        %{state | timer: nil, wake: nil}

      at_ms ->
        wake = make_ref()

        timer =
          Process.send_after(self(), {:visca_wake, wake}, max(at_ms, Hal.Clock.now_ms()),
            abs: true
          )

        %{state | timer: timer, wake: wake}
    end
  end

  defp cancel(%{timer: nil}), do: :ok
  defp cancel(%{timer: timer}), do: Process.cancel_timer(timer)
end
