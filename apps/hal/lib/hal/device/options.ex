defmodule Hal.Device.Options do
  @moduledoc "The options of `Hal.Device`, checked once. Pure."
  alias Hal.Device.Arming

  @doc "The fields of a device; `ArgumentError` names an option, its value and what it must be."
  @spec check!(keyword()) :: keyword()
  def check!(options) do
    options =
      Keyword.validate!(options, [
        :kind,
        :driver,
        :device,
        arm: :auto,
        sonar: false,
        was: nil,
        about: %{},
        sinks: [],
        clock: {System, :monotonic_time, [:millisecond]}
      ])

    unless options[:kind] in [:drive, :ptz, :camera],
      do: refuse!(:kind, options[:kind], ":drive, :ptz or :camera")

    unless options[:arm] in [:auto, :manual, :never],
      do: refuse!(:arm, options[:arm], ":auto, :manual or :never")

    unless is_boolean(options[:sonar]),
      do: refuse!(:sonar, options[:sonar], "true or false")

    unless options[:was] == nil or match?({_m, _f, _a}, options[:was]),
      do: refuse!(:was, options[:was], "{module, function, arguments} or nil")

    unless is_map(options[:about]),
      do: refuse!(:about, options[:about], "a map")

    {driver, driver_options} =
      case options[:driver] do
        {module, list} when is_atom(module) and is_list(list) -> {module, list}
        other -> refuse!(:driver, other, "{module, options}")
      end

    [
      kind: options[:kind],
      device: options[:device] || options[:kind],
      driver: driver,
      options: driver_options,
      arming: if(options[:kind] == :drive, do: Arming.new(options[:arm])),
      sonar?: options[:sonar],
      was: options[:was],
      about: options[:about],
      sinks: options[:sinks],
      clock: options[:clock]
    ]
  end

  @spec refuse!(atom(), term(), String.t()) :: no_return()
  defp refuse!(option, value, allowed) do
    raise ArgumentError,
          "device option #{inspect(option)} cannot be #{inspect(value)}: it must be #{allowed}"
  end
end
