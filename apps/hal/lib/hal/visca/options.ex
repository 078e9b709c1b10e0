defmodule Hal.Visca.Options do
  @moduledoc """
  Checks the options of `Hal.Visca.Driver`. Pure.

  | option | | default |
  |---|---|---|
  | `:port` | path of the serial device | required |
  | `:speed` | baud, 1 to 20,000,000 | `9600`, that of the camera |
  | `:serial` | `:module` and `:keep_alive_ms` of `Hal.Serial.open/1` | `[]` |
  | `:camera` | 1 to 7: its place on the cable | `1` |
  | `:model` | `:d30`, `:d70` or `:d100`: taken for this model, whatever it says that it is, with a warning if it says another | `nil`: what it says |
  | `:lens` | `{tele, wide}`: horizontal fields of view in radians, above 0, ascending, below pi | that of the model: 4.4 and 48.8 degrees for a D30 |
  | `:field_of_view` | radians to zoom to at the opening, above 0 and below pi; `nil`: leave it unchanged | `nil` |
  | `:poll_ms` | 50 to 400: interval between inquiries of the position | `100` |
  """
  alias Hal.{Options, Serial}

  @lens "{tele, wide}, fields of view in radians, ascending, between 0 and pi,"
  @table [
    port: [:path, required: true],
    speed: [{:integer, 1, 20_000_000, "baud"}, default: 9_600],
    serial: [{:keys, Keyword.take(Serial.table(), [:module, :keep_alive_ms])}, default: []],
    camera: [{:integer, 1, 7}, default: 1],
    model: [{:one_of, [:d30, :d70, :d100]}, default: nil],
    lens: [{:check, &__MODULE__.lens?/1, @lens}, default: nil],
    field_of_view: [
      {:check, &__MODULE__.angle?/1, "a number of radians between 0 and pi"},
      default: nil
    ],
    poll_ms: [{:integer, 50, 400, "ms"}, default: 100]
  ]

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc """
  Checks the options and adds the defaults; the error is one line that says what is wrong.

      iex> {:ok, options} = Hal.Visca.Options.check(port: "/dev/ttyS2")
      iex> {options[:speed], options[:poll_ms]}
      {9600, 100}
      iex> Hal.Visca.Options.check(port: "/dev/ttyS2", camera: 8)
      {:error, "visca option camera: expected a whole number from 1 to 7, got 8"}
  """
  @spec check(keyword()) :: {:ok, keyword()} | {:error, String.t()}
  def check(options), do: Options.check(options, @table, "visca")

  @doc "The options of the serial line, from those that `check/1` returns."
  @spec serial(keyword()) :: keyword()
  def serial(options), do: Keyword.merge(options[:serial], Keyword.take(options, [:port, :speed]))

  @doc false
  def lens?({tele, wide}), do: angle?(tele) and angle?(wide) and tele < wide
  def lens?(_other), do: false

  @doc false
  def angle?(angle), do: is_number(angle) and angle > 0 and angle < :math.pi()
end
