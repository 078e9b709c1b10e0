defmodule Hal.Device.Options do
  @moduledoc "Checks the options of `Hal.Device`, where they are listed. Pure."
  alias Hal.Device.Arming
  alias Hal.Options

  @table [
    kind: [{:one_of, [:drive, :ptz, :camera]}, required: true],
    driver: [:driver, required: true],
    device: [{:check, &is_atom/1, "a name"}, default: nil],
    arm: [{:one_of, [:auto, :manual, :never]}, default: :auto],
    sonar: [:boolean, default: false],
    was: [:mfa, default: nil],
    disarmed: [:mfa, default: nil],
    about: [{:check, &is_map/1, "a map"}, default: %{}],
    sinks: [{:list, :mfa}, default: []],
    clock: [:mfa, default: {System, :monotonic_time, [:millisecond]}]
  ]

  @doc """
  The fields of a device's state; an `ArgumentError` names the option, its value and what is
  allowed.
  """
  @spec check!(keyword()) :: keyword()
  def check!(options) do
    options = Options.check!(options, @table, "device")
    {driver, driver_options} = options[:driver]

    Keyword.take(options, [:kind, :was, :disarmed, :about, :sinks, :clock]) ++
      [
        device: options[:device] || options[:kind],
        driver: driver,
        options: driver_options,
        arming: if(options[:kind] == :drive, do: Arming.new(options[:arm])),
        sonar?: options[:sonar]
      ]
  end
end
