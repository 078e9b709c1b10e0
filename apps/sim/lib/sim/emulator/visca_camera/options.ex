defmodule Sim.Emulator.ViscaCamera.Options do
  @moduledoc """
  Checks the options of an emulated camera. Pure.

  | option | allowed | default |
  |---|---|---|
  | `:latency_ms` | 0 to 1000: how long it takes to answer | 16 |
  | `:power` | `:on`, `:off`: state when it gets power | `:on` |
  | `:power_on_ms` | 0 to 60000: from the power command to its completion | 2000 |
  | `:drive_done` | `:at_once`, `:at_stop`: when a drive is reported as completed | `:at_once` |
  | `:zoom_ms` | 1 to 60000: from wide to tele | 2000 |
  | `:lens` | `{tele, wide}`, fields of view in radians; interpolated between them by the zoom position | 4.4 and 48.8 degrees |
  | `:drop` | share of answers that are lost, 0 to 1 | 0 |
  | `:seed` | whole number, seed of the dropped answers | 0 |
  | `:announce` | whether it announces itself to the chain when it gets power again | true |
  """

  alias Hal.Options

  @degree :math.pi() / 180
  @table [
    latency_ms: [{:integer, 0, 1_000, "ms"}, default: 16],
    power: [{:one_of, [:on, :off]}, default: :on],
    power_on_ms: [{:integer, 0, 60_000, "ms"}, default: 2_000],
    drive_done: [{:one_of, [:at_once, :at_stop]}, default: :at_once],
    zoom_ms: [{:integer, 1, 60_000, "ms"}, default: 2_000],
    lens: [
      {:check, &__MODULE__.lens?/1, "{tele, wide} in radians, ascending, less than 3,"},
      default: {4.4 * @degree, 48.8 * @degree}
    ],
    drop: [{:number, 0, 1}, default: 0],
    seed: [:integer, default: 0],
    announce: [:boolean, default: true]
  ]

  @doc """
  All options; the error is one line that names what is wrong.

      iex> {:ok, options} = Sim.Emulator.ViscaCamera.Options.check(latency_ms: 5)
      iex> {options.latency_ms, options.power}
      {5, :on}
      iex> Sim.Emulator.ViscaCamera.Options.check(power: 1)
      {:error, "emulated camera option power: expected :on or :off, got 1"}
  """
  @spec check(keyword()) :: {:ok, map()} | {:error, line :: String.t()}
  def check(asked) do
    with {:ok, options} <- Options.check(asked, @table, "emulated camera"),
         do: {:ok, Map.new(options)}
  end

  @doc false
  def lens?({tele, wide}),
    do: is_number(tele) and is_number(wide) and tele > 0 and wide > tele and wide < 3

  def lens?(_other), do: false
end
