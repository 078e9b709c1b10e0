defmodule Sim.Emulator.RFlexController.Options do
  @moduledoc """
  What an emulated controller is like, checked. Pure. All options have defaults, those of the `:kind`.

  | option | allowed | meaning |
  |---|---|---|
  | `:kind` | `:magellan`, `:atrv_mini` | whose conversions, sonars, infrareds and bumpers (`:magellan`) |
  | `:conversions` | keywords `distance`, `angle`, `range`, `ir_a`, `ir_b`; numbers, not 0 | counts a metre, counts a radian, raw sonar a metre; infrared range = a V^b metres |
  | `:sonar_banks`, `:ir_banks` | lists of 0 to 16, 0 to 8 | sensors fitted on each board |
  | `:ir_wiring` | list of whole numbers | the profile's infrared on each input, bank after bank |
  | `:sonar_per_report` | 1 to 64 | after how many echoes they are told (4) |
  | `:missed_echo` | 0 to 0xFFFF | raw range when no echo comes (0x7FFF) |
  | `:sonar_max`, `:ir_max` | metres | from where on the body's ranges mean nothing was there (5.1, 0.8) |
  | `:bumper_style` | `:bit`, `:address` | one bit or one address a bumper (`:bit`) |
  | `:bumper_base`, `:bumpers` | byte, 0 to 16 | first address, how many there are |
  | `:counters` | `{distance, bearing}` | what they count from, signed 32 bits (`{0, 0}`) |
  | `:timeout_ms` | whole number or `:off` | motors stop when no motion command came for so long (1000) |
  | `:brake` | `:set`, `:released` | when it is switched on (`:set`); a set brake holds the wheels |
  | `:ghost` | `:off`, `:infrared`, `:all` | see `Sim.Emulator.RFlexController.Frame` |
  | `:escape` | `:drop`, `:take` | turn commands with 1B in their top or third byte are lost, or not (`:drop`) |
  | `:pace` | `{ms, room}` or `:off` | a command each so many ms, and no more than room may wait (`:off`) |
  | `:give_up_ms` | 1 to 10000 | how long the rest of a command is waited for (50) |
  | `:phrase` | bytes or `nil` | text on the line that switches it off ("The system is halted", R95) |
  | `:power_offset` | volts | what the true voltage is above the reported one (0.0; mini 1.2) |
  | `:home` | `{address, from, to}` or `nil` | switch that is closed between two bearings, radians |
  | `:id` | byte | of the first report (0) |
  """

  @magellan %{
    kind: :magellan,
    conversions: [distance: 31_387, angle: 4654.2, range: 1474, ir_a: 4000, ir_b: -2],
    sonar_banks: [8, 8],
    ir_banks: [8, 8],
    # The second board counts from right of the front outwards, then from the left to the front.
    ir_wiring: Enum.to_list(0..7) ++ [12, 13, 14, 15, 8, 9, 10, 11],
    sonar_per_report: 4,
    missed_echo: 0x7FFF,
    sonar_max: 5.1,
    ir_max: 0.8,
    bumper_style: :bit,
    bumper_base: 0x40,
    bumpers: 16,
    counters: {0, 0},
    timeout_ms: 1_000,
    brake: :set,
    ghost: :infrared,
    escape: :drop,
    pace: :off,
    give_up_ms: 50,
    phrase: "The system is halted",
    power_offset: 0.0,
    home: nil,
    id: 0
  }

  @atrv_mini %{
    @magellan
    | kind: :atrv_mini,
      conversions: [distance: 190_000, angle: 60_000, range: 1476, ir_a: 4000, ir_b: -2],
      ir_banks: [],
      ir_wiring: [],
      bumpers: 0,
      power_offset: 1.2
  }

  @names @magellan |> Map.keys() |> Enum.sort()

  @doc """
  All options of a controller, or one line that names what is wrong.

      iex> {:ok, options} = Sim.Emulator.RFlexController.Options.check(kind: :atrv_mini, timeout_ms: :off)
      iex> {options.conversions[:angle], options.timeout_ms}
      {60000, :off}
      iex> Sim.Emulator.RFlexController.Options.check(ghost: :yes)
      {:error, "controller option :ghost cannot be :yes: :off, :infrared or :all"}
  """
  @spec check(keyword()) :: {:ok, map()} | {:error, line :: String.t()}
  def check(asked) do
    with {:ok, base} <- base(Keyword.get(asked, :kind, :magellan)) do
      Enum.reduce_while(asked, {:ok, base}, &take/2)
    end
  end

  defp base(:magellan), do: {:ok, @magellan}
  defp base(:atrv_mini), do: {:ok, @atrv_mini}
  defp base(other), do: refuse(:kind, other, ":magellan or :atrv_mini")

  defp take({name, _value}, _options) when name not in @names do
    {:halt, {:error, "unknown controller option #{inspect(name)}: #{Enum.join(@names, ", ")}"}}
  end

  defp take({:conversions, value}, {:ok, options}) do
    known = Keyword.keys(@magellan.conversions)

    if Keyword.keyword?(value) and
         Enum.all?(value, fn {name, number} ->
           name in known and is_number(number) and number != 0
         end),
       do: {:cont, {:ok, Map.update!(options, :conversions, &Keyword.merge(&1, value))}},
       else: {:halt, refuse(:conversions, value, "numbers for #{Enum.join(known, ", ")}, not 0")}
  end

  defp take({name, value}, {:ok, options}) do
    case allowed(name, value) do
      true -> {:cont, {:ok, Map.put(options, name, value)}}
      allowed -> {:halt, refuse(name, value, allowed)}
    end
  end

  defp refuse(name, value, allowed),
    do: {:error, "controller option #{inspect(name)} cannot be #{inspect(value)}: #{allowed}"}

  defp allowed(:kind, _checked), do: true
  defp allowed(:sonar_banks, list), do: banks?(list, 16) or "a list of 0 to 16 for each board"
  defp allowed(:ir_banks, list), do: banks?(list, 8) or "a list of 0 to 8 for each board"

  defp allowed(:ir_wiring, list),
    do: banks?(list, 63) or "a list of places in the profile, from 0"

  defp allowed(:sonar_per_report, n), do: (is_integer(n) and n in 1..64) or "1 to 64"
  defp allowed(:missed_echo, n), do: (is_integer(n) and n in 0..0xFFFF) or "0 to 0xFFFF"

  defp allowed(name, metres) when name in [:sonar_max, :ir_max],
    do: (is_number(metres) and metres > 0) or "metres"

  defp allowed(:bumper_style, style), do: style in [:bit, :address] or ":bit or :address"
  defp allowed(:bumpers, n), do: (is_integer(n) and n in 0..16) or "0 to 16"

  defp allowed(name, n) when name in [:id, :bumper_base],
    do: (is_integer(n) and n in 0..255) or "a byte"

  defp allowed(:counters, {a, b}) when is_integer(a) and is_integer(b), do: true
  defp allowed(:counters, _other), do: "{distance, bearing}, whole numbers"
  defp allowed(:timeout_ms, n), do: n == :off or positive?(n) or "whole milliseconds or :off"
  defp allowed(:brake, brake), do: brake in [:set, :released] or ":set or :released"
  defp allowed(:ghost, ghost), do: ghost in [:off, :infrared, :all] or ":off, :infrared or :all"
  defp allowed(:escape, escape), do: escape in [:drop, :take] or ":drop or :take"
  defp allowed(:pace, :off), do: true

  defp allowed(:pace, {ms, room})
       when is_integer(ms) and is_integer(room) and ms > 0 and room > 0,
       do: true

  defp allowed(:pace, _other), do: "{ms, room} or :off"
  defp allowed(:give_up_ms, n), do: (is_integer(n) and n in 1..10_000) or "1 to 10000"

  defp allowed(:phrase, text),
    do: text == nil or (is_binary(text) and byte_size(text) in 1..256) or "up to 256 bytes or nil"

  defp allowed(:power_offset, volts), do: is_number(volts) or "volts"
  defp allowed(:home, nil), do: true

  defp allowed(:home, {address, from, to})
       when address in 0..255 and is_number(from) and is_number(to),
       do: true

  defp allowed(:home, _other), do: "{address, from, to} or nil"

  defp positive?(n), do: is_integer(n) and n > 0

  defp banks?(list, most),
    do:
      is_list(list) and length(list) <= 64 and
        Enum.all?(list, &(is_integer(&1) and &1 in 0..most))
end
