defmodule Hal.SerialDrive do
  @moduledoc """
  A drive behind a serial line: each byte that comes is the battery's voltage, and says that the wheels are
  there. Options as `Hal.Serial`.
  """
  @behaviour Hal.Drive
  alias Hal.Serial

  @impl Hal.Drive
  def init(options), do: Serial.open(options)

  @impl Hal.Drive
  def drive(twist, line), do: result(Serial.write(line, "#{twist.linear}\r"), line)

  @impl Hal.Drive
  def handle_message(message, line) do
    case Serial.handle(line, message) do
      {:data, bytes} ->
        {:ok, [{:report, :wheels} | for(<<volts <- bytes>>, do: {:power, volts * 1.0})], line}

      {:error, reason} ->
        {:error, reason, line}

      :unknown ->
        {:ok, [], line}
    end
  end

  @impl Hal.Drive
  def terminate(line), do: Serial.close(line)

  defp result(:ok, line), do: {:ok, line}
  defp result({:error, reason}, line), do: {:error, reason, line}
end
