defmodule Hal.Lidar.Line do
  @moduledoc """
  Owns the serial line and the clock of a lidar whose words are a `Hal.Lidar.Session`: all that its driver does. The last words
  of the line stop the lidar, so that it does not turn for ever when the program has ended.
  """
  alias Hal.Serial

  # Nobody is hurt by a lidar that turns: the line may be silent for longer than that of wheels.
  @keep_alive_ms 2_000
  @sign_ms 500

  @enforce_keys [:line, :module, :session]
  defstruct @enforce_keys ++ [timer: nil, wake: nil]

  @opaque t :: %__MODULE__{
            line: Serial.t(),
            module: module(),
            session: Hal.Lidar.Session.t(),
            timer: reference() | nil,
            wake: reference() | nil
          }

  @doc """
  Opens a line for a session; `serial` are options of `Hal.Serial.open/1`, whose errors it returns.
  """
  @spec open(module(), keyword(), serial :: keyword()) :: {:ok, t()} | {:error, term()}
  def open(module, options, serial) do
    ours = [last_words: module.stop(options), keep_alive_ms: @keep_alive_ms]

    with {:ok, line} <- Serial.open(serial ++ ours) do
      {effects, session} = module.new(options, Hal.Clock.now_ms())

      case carry_out(effects, %__MODULE__{line: line, module: module, session: session}) do
        {:ok, [], t} ->
          {:ok, t}

        {:error, reason, t} ->
          close(t)
          {:error, reason}
      end
    end
  end

  @doc "As `c:Hal.Lidar.handle_message/2`."
  @spec handle_message(term(), t()) :: {:ok, [Hal.Lidar.reading()], t()} | {:error, term(), t()}
  def handle_message({:lidar_wake, wake}, %__MODULE__{wake: wake} = t) do
    now_ms = Hal.Clock.now_ms()

    with :ok <- Serial.keep_alive(t.line) do
      if t.module.wake_ms(t.session) <= now_ms,
        do: handle(t.module.tick(t.session, now_ms), t),
        else: {:ok, [], wake(t)}
    else
      {:error, reason} -> {:error, reason, t}
    end
  end

  def handle_message({:lidar_wake, _old}, %__MODULE__{} = t), do: {:ok, [], t}

  def handle_message(message, %__MODULE__{} = t) do
    case Serial.handle(t.line, message) do
      {:data, bytes} -> handle(t.module.bytes(t.session, bytes, Hal.Clock.now_ms()), t)
      {:error, reason} -> {:error, reason, t}
      :unknown -> {:ok, [], t}
    end
  end

  @doc "Stops the lidar, and closes the line."
  @spec close(t()) :: :ok
  def close(%__MODULE__{} = t) do
    cancel(t)
    Serial.close(t.line)
  end

  defp handle({effects, session}, t), do: carry_out(effects, %{t | session: session})

  defp carry_out(effects, t) do
    case Enum.reduce_while(effects, {:ok, []}, &effect(&1, &2, t.line)) do
      {:ok, readings} -> {:ok, Enum.reverse(readings), wake(t)}
      {:error, reason} -> {:error, reason, t}
    end
  end

  defp effect({:error, reason}, _readings, _line), do: {:halt, {:error, reason}}

  defp effect({:write, bytes}, readings, line) do
    case Serial.write(line, bytes) do
      :ok -> {:cont, readings}
      {:error, reason} -> {:halt, {:error, reason}}
    end
  end

  defp effect(reading, {:ok, readings}, _line), do: {:cont, {:ok, [reading | readings]}}

  defp wake(t) do
    cancel(t)
    now_ms = Hal.Clock.now_ms()
    at_ms = t.session |> t.module.wake_ms() |> max(now_ms) |> min(now_ms + @sign_ms)
    wake = make_ref()
    timer = Process.send_after(self(), {:lidar_wake, wake}, at_ms, abs: true)
    %{t | timer: timer, wake: wake}
  end

  defp cancel(%{timer: nil}), do: :ok
  defp cancel(%{timer: timer}), do: Process.cancel_timer(timer)
end
