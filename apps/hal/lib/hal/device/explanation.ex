defmodule Hal.Device.Explanation do
  @moduledoc "Describes what is wrong with a device, in one line for people. Pure."

  @longest 240

  @doc """
  Why the device is offline: the driver's explanation of the reason (`c:Hal.Drive.explain/2`), or
  the reason itself; `nil` stands for an unknown driver.

      iex> Hal.Device.Explanation.offline({Hal.RFlex.Driver, port: "/dev/ttyR0"}, :enoent)
      "/dev/ttyR0: no such device"
      iex> Hal.Device.Explanation.offline({Some.Driver, []}, :odd)
      ":odd"
      iex> Hal.Device.Explanation.offline({Hal.RFlex.Driver, port: "/dev/ttyR0"}, :fell)
      "its process crashed, and is started again"
      iex> long = Hal.Device.Explanation.offline({Hal.RFlex.Driver, port: String.duplicate("/dir", 99)}, :enoent)
      iex> {String.length(long), String.ends_with?(long, "…" <> String.slice(long, -119, 119)), long =~ "no such device"}
      {239, true, true}
      iex> Hal.Device.Explanation.offline({Some.Driver, []}, {:refuses, :look, "it does not know the command"})
      "it refuses every look: it does not know the command"
  """
  @spec offline({driver :: module() | nil, options :: keyword()}, reason :: term()) :: String.t()
  def offline(_driver, :fell), do: "its process crashed, and is started again"

  def offline(_driver, {:refuses, request, line}) when is_binary(line),
    do: String.slice("it refuses every #{request}: #{line}", 0, @longest)

  def offline(_driver, {:stands, :head}),
    do: "it stood still when it was told to look elsewhere"

  def offline(_driver, {:stands, :wheels}) do
    "its wheels stood still when they were told to turn (is an emergency button pressed, a brake set, or the way " <>
      "blocked?)"
  end

  def offline({driver, options}, reason) do
    if driver != nil and Code.ensure_loaded?(driver) and function_exported?(driver, :explain, 2),
      do: reason |> driver.explain(options) |> shorten(),
      else: plain(reason)
  end

  # Both ends stay: a driver names its line first, and then what is wrong with it.
  defp shorten(text) do
    half = div(@longest - 1, 2)

    if String.length(text) > @longest,
      do: String.slice(text, 0, half) <> "…" <> String.slice(text, -half, half),
      else: text
  end

  defp plain(:mute), do: "it is open, and nothing comes from it"
  defp plain(:silent), do: "its base does not report its wheels"
  defp plain(reason), do: inspect(reason, limit: 5, printable_limit: 40)
end
