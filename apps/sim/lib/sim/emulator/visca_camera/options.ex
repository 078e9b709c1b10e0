defmodule Sim.Emulator.ViscaCamera.Options do
  @moduledoc """
  What an emulated camera is like, checked. Pure.

  | option | allowed | default |
  |---|---|---|
  | `:latency_ms` | 0 to 1000: how long it thinks before it answers | 16 |
  | `:power` | `:on`, `:off`, when it gets current | `:on` |
  | `:power_on_ms` | 0 to 60000: from the power command to its completion | 2000 |
  | `:drive_done` | `:at_once`, `:at_stop`: when a drive is said to be completed | `:at_once` |
  | `:zoom_ms` | 1 to 60000: from wide to tele | 2000 |
  | `:lens` | `{tele, wide}`, fields of view in radians; between them they go by the zoom's number | 4.4 and 48.8 degrees |
  | `:drop` | share of answers never given, 0 to 1 | 0 |
  | `:seed` | whole number, of what is dropped | 0 |
  | `:announce` | whether it tells the chain when it gets current again | true |
  """

  @defaults %{
    latency_ms: 16,
    power: :on,
    power_on_ms: 2_000,
    drive_done: :at_once,
    zoom_ms: 2_000,
    lens: {4.4 * :math.pi() / 180, 48.8 * :math.pi() / 180},
    drop: 0,
    seed: 0,
    announce: true
  }
  @names @defaults |> Map.keys() |> Enum.sort()

  @doc """
  All options, or one line that names what is wrong.

      iex> {:ok, options} = Sim.Emulator.ViscaCamera.Options.check(latency_ms: 5)
      iex> {options.latency_ms, options.power}
      {5, :on}
      iex> Sim.Emulator.ViscaCamera.Options.check(power: 1)
      {:error, "camera option :power cannot be 1: :on or :off"}
  """
  @spec check(keyword()) :: {:ok, map()} | {:error, line :: String.t()}
  def check(asked), do: Enum.reduce_while(asked, {:ok, @defaults}, &take/2)

  defp take({name, _value}, _options) when name not in @names,
    do: {:halt, {:error, "unknown camera option #{inspect(name)}: #{Enum.join(@names, ", ")}"}}

  defp take({name, value}, {:ok, options}) do
    case allowed(name, value) do
      true ->
        {:cont, {:ok, Map.put(options, name, value)}}

      allowed ->
        {:halt,
         {:error, "camera option #{inspect(name)} cannot be #{inspect(value)}: #{allowed}"}}
    end
  end

  defp allowed(:latency_ms, ms), do: (is_integer(ms) and ms in 0..1_000) or "0 to 1000"
  defp allowed(:power, power), do: power in [:on, :off] or ":on or :off"
  defp allowed(:power_on_ms, ms), do: (is_integer(ms) and ms in 0..60_000) or "0 to 60000"
  defp allowed(:zoom_ms, ms), do: (is_integer(ms) and ms in 1..60_000) or "1 to 60000"

  defp allowed(:lens, {tele, wide})
       when is_number(tele) and is_number(wide) and tele > 0 and wide > tele and wide < 3,
       do: true

  defp allowed(:lens, _other), do: "{tele, wide} in radians, less than 3"
  defp allowed(:drive_done, when?), do: when? in [:at_once, :at_stop] or ":at_once or :at_stop"

  defp allowed(:drop, share),
    do: (is_number(share) and share >= 0 and share <= 1) or "a share from 0 to 1"

  defp allowed(:seed, seed), do: is_integer(seed) or "a whole number"
  defp allowed(:announce, yes?), do: is_boolean(yes?) or "true or false"
end
