defmodule Hal.Device.Words do
  @moduledoc "Describes what is wrong with a device, in one line for people. Pure."

  @longest 240

  @doc """
  Why the device is offline: the driver's explanation of the reason (`c:Hal.Drive.explain/2`), or
  the reason itself; `nil` stands for an unknown driver.

      iex> Hal.Device.Words.offline({Hal.RFlex.Driver, port: "/dev/ttyR0"}, :enoent)
      "/dev/ttyR0: no such device"
      iex> Hal.Device.Words.offline({Some.Driver, []}, :odd)
      ":odd"
      iex> Hal.Device.Words.offline({Hal.RFlex.Driver, port: "/dev/ttyR0"}, :fell)
      "its process crashed, and is started again"
  """
  @spec offline({driver :: module() | nil, options :: keyword()}, reason :: term()) :: String.t()
  def offline(_driver, :fell), do: "its process crashed, and is started again"

  def offline({driver, options}, reason) do
    if driver != nil and Code.ensure_loaded?(driver) and function_exported?(driver, :explain, 2),
      do: reason |> driver.explain(options) |> String.slice(0, @longest),
      else: plain(reason)
  end

  defp plain(:mute), do: "it is open, and nothing comes from it"
  defp plain(:silent), do: "its base does not report its wheels"
  defp plain(reason), do: inspect(reason, limit: 5, printable_limit: 40)
end
