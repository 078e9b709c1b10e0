defmodule Player.Boards do
  @moduledoc """
  Works out the pose and the board of each sonar and infrared from several of Player's options.
  Pure.
  """
  import Player.State
  alias Hal.RFlex.Driver
  alias Player.State
  alias Robot.File.Bodies

  # Options that must not be guessed: they say where each sensor is, and a robot drives by its
  # sensors.
  @sensors ~w(mmrad_sonar_poses mrad_sonar_poses num_sonars num_sonars_in_bank
              num_sonars_possible_per_bank poses rflex_banks rflex_base_bank)

  @doc """
  Checks that all that the file says about sonars and infrareds was carried over. If not, the
  error says which line was not, and why: a robot whose sensors are elsewhere than it thinks is
  worse than none.
  """
  @spec sure(State.t()) :: :ok | {:error, {line :: pos_integer(), why :: String.t()}}
  def sure(state) do
    case Enum.sort(for {_, name, _} = remark <- state.left, name in @sensors, do: remark) do
      [] -> :ok
      [{line, name, why} | _more] -> {:error, {line, "#{name}: #{why}"}}
    end
  end

  @doc "Makes boards and poses consistent, for a body of that kind."
  @spec complete(State.t(), body :: atom()) :: State.t()
  def complete(state, kind) do
    {:ok, body} = Bodies.fetch(kind)
    state |> banked(body) |> ringed(body) |> paced(body)
  end

  # Each time is possible, and with all the sonars they may still be too long: a range would be too old to drive by.
  defp paced(state, body) do
    options =
      for key <- [:sonar_banks, :sonar_times],
          value = value(state, [:drive, key]),
          do: {key, value}

    profile = %{body | sonars: value(state, [:body, :sonars]) || body.sonars}
    seconds = Driver.sonar_round_s([port: "/dev/null", profile: profile] ++ options)
    longest = Robot.Config.longest_sonar_round_s()

    if seconds > longest,
      do:
        leave(
          state,
          [[:drive, :sonar_times]],
          "a round of the sonars would take #{seconds} s, and #{longest} s are allowed"
        ),
      else: state
  end

  # If the file has no poses, the sonars of our profile are used.
  defp banked(state, body) do
    banks = value(state, [:drive, :sonar_banks])
    sonars = value(state, [:body, :sonars])
    count = length(sonars || body.sonars)

    cond do
      banks == nil and sonars != nil and rem(count, 8) != 0 ->
        {_, _, line, _option} = List.keyfind(state.values, [:body, :sonars], 0)

        why = "is not given: taken for boards of 8, #{count} sonars in all"
        assume(state, line, "num_sonars_in_bank", why)

      banks == nil or (sonars != nil and Enum.sum(banks) == count) ->
        state

      Enum.sum(banks) == count ->
        assume(state, [:drive, :sonar_banks], of_body(body))

      true ->
        why =
          "adds up to #{Enum.sum(banks)} sonars, and there are no poses; a #{body.name} has #{count}"

        leave(state, [[:drive, :sonar_banks]], why)
    end
  end

  defp of_body(body), do: "there are no poses: those of a #{body.name} are taken"

  # Player lists poses in the order of the reports, unlike our profile.
  defp ringed(state, body) do
    case value(state, [:body, :irs]) do
      nil ->
        unplaced(state, value(state, [:drive, :ir_banks]), body)

      [] ->
        state |> boardless() |> calibrated(0)

      irs ->
        state =
          keep(state, 1, "poses", [
            {[:drive, :ir_order], Enum.to_list(0..(length(irs) - 1))}
          ])

        state |> boarded(length(irs)) |> calibrated(length(irs))
    end
  end

  defp unplaced(state, nil, _body), do: state

  defp unplaced(state, banks, body) do
    if Enum.sum(banks) == length(body.irs) do
      assume(state, [:drive, :ir_banks], of_body(body))
    else
      why = "adds up to #{Enum.sum(banks)} infrareds, and there are no poses of them"
      leave(state, [[:drive, :ir_banks]], why)
    end
  end

  defp boarded(state, irs) do
    banks = value(state, [:drive, :ir_banks])

    cond do
      banks == nil ->
        keep(state, 1, "poses", [{[:drive, :ir_banks], boards(irs)}])

      Enum.sum(banks) == irs ->
        state

      true ->
        state |> unboarded(irs) |> boarded(irs)
    end
  end

  # Boards of none say nothing; others contradict the poses.
  defp boardless(state) do
    none? = &match?({[:drive, :ir_banks], [_ | _], _, _}, &1)

    if Enum.sum(value(state, [:drive, :ir_banks]) || []) == 0,
      do: %{state | values: Enum.reject(state.values, none?)},
      else: unboarded(state, 0)
  end

  defp unboarded(state, irs) do
    leave(state, [[:drive, :ir_banks]], "is not for #{irs} infrareds")
  end

  defp boards(irs) when irs <= 8, do: [irs]
  defp boards(irs), do: [8 | boards(irs - 8)]

  defp calibrated(state, irs) do
    case value(state, [:drive, :conversions, :ir_a]) do
      as when is_list(as) and length(as) != irs ->
        laws = for name <- [:ir_a, :ir_b], do: [:drive, :conversions, name]
        leave(state, laws, "is for #{length(as)} infrareds, not for #{irs}")

      nil ->
        {_, _, line, _option} = List.keyfind(state.values, [:body, :irs], 0)
        why = "is not given, so that no infrared is read"
        assume(state, line, "rflex_ir_calib", why)

      _one_or_as_many ->
        state
    end
  end
end
