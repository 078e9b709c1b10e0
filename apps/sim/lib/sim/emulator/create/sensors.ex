defmodule Sim.Emulator.Create.Sensors do
  @moduledoc false
  # Writes the sensor packets of an emulated Create 2, by the fact sheet. Pure. What it has not is 0.
  import Bitwise

  @metres_per_count 4.44565e-4
  @base 0.235

  # The sizes of the packets 7 to 58, one after the other.
  @sizes [
           [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2],
           [1, 2, 2, 1, 2, 2],
           [2, 2, 2, 2, 2, 1, 2, 1],
           [1, 1, 1, 1, 2, 2, 2, 2],
           [2, 2, 1, 2, 2, 2, 2, 2, 2, 1, 1, 2, 2, 2, 2, 1]
         ]
         |> Enum.concat()
         |> Enum.with_index(7)
         |> Map.new(fn {size, id} -> {id, size} end)

  @groups %{
    0 => 7..26,
    1 => 7..16,
    2 => 17..20,
    3 => 21..26,
    4 => 27..34,
    5 => 35..42,
    6 => 7..42,
    100 => 7..58,
    101 => 43..58,
    106 => 46..51,
    107 => 54..58
  }

  @doc "The data of these packets and groups, without ids; unknown ones have none."
  @spec data(Sim.Emulator.Create.t(), [byte()]) :: binary()
  def data(core, ids) do
    for id <- ids, packet <- Map.get(@groups, id, [id]), size = @sizes[packet], into: <<>> do
      <<number(core, packet)::size(size)-unit(8)>>
    end
  end

  defp number(core, 7), do: core.bumps ||| core.drops
  defp number(core, id) when id in 9..12, do: core.cliffs >>> (12 - id) &&& 1
  defp number(core, 14), do: core.overcurrent
  # Whole millimetres and degrees since they were read last.
  defp number(core, 19), do: round(1_000 * (since(core, 0) + since(core, 1)) / 2)
  defp number(core, 20), do: round((since(core, 1) - since(core, 0)) / @base * 180 / :math.pi())
  defp number(core, 22), do: core.options.millivolts
  defp number(_core, 24), do: 25
  defp number(_core, 25), do: 2_000
  defp number(_core, 26), do: 2_696
  defp number(core, 34), do: core.charger
  defp number(%{mode: mode}, 35) when is_integer(mode), do: mode
  defp number(core, 41), do: round(1_000 * elem(core.wheels.told, 1))
  defp number(core, 42), do: round(1_000 * elem(core.wheels.told, 0))
  defp number(core, 43), do: counter(core, 0)
  defp number(core, 44), do: counter(core, 1)
  defp number(_core, _nothing), do: 0

  defp since(core, n), do: elem(core.wheels.gone, n) - elem(core.read, n)

  defp counter(core, n),
    do: elem(core.options.counters, n) + round(elem(core.wheels.gone, n) / @metres_per_count)
end
