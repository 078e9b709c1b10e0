defmodule Hal.Ptz.HistoryTest do
  use ExUnit.Case, async: true
  alias Hal.Ptz
  doctest Hal.Ptz.History

  defp looks(pan, more \\ %{}),
    do: Map.merge(%{pan: pan, tilt: -pan / 2, field_of_view: 0.8 + pan / 10}, more)

  defp track(readings),
    do:
      Enum.reduce(readings, Ptz.History.new(), fn {ms, pan}, aim ->
        Ptz.History.note(aim, looks(pan), ms)
      end)

  test "between readings, exactly at them, and before" do
    aim = track([{100, 0.0}, {200, 0.4}, {300, 0.0}])
    assert Ptz.History.at(aim, 100) == looks(0.0)
    assert_in_delta Ptz.History.at(aim, 125).pan, 0.1, 1.0e-9
    assert_in_delta Ptz.History.at(aim, 125).tilt, -0.05, 1.0e-9
    assert_in_delta Ptz.History.at(aim, 125).field_of_view, 0.81, 1.0e-9
    assert Ptz.History.at(aim, 200) == looks(0.4)
    assert_in_delta Ptz.History.at(aim, 275).pan, 0.1, 1.0e-9
    assert Ptz.History.at(aim, 300) == looks(0.0)
    assert Ptz.History.at(aim, 99) == nil
  end

  test "after the last it goes on for 100 ms, but not the lens, and is good for a second" do
    aim = track([{100, 0.0}, {200, 0.4}])
    assert_in_delta Ptz.History.at(aim, 250).pan, 0.6, 1.0e-9
    assert_in_delta Ptz.History.at(aim, 1_200).pan, 0.8, 1.0e-9
    assert_in_delta Ptz.History.at(aim, 1_200).field_of_view, 0.84, 1.0e-9
    assert Ptz.History.at(aim, 1_201) == nil
  end

  test "a reading that says how old it is counts from then; late ones and doubles are passed over" do
    aim = Ptz.History.new() |> Ptz.History.note(looks(0.1, %{age_ms: 20}), 120)
    assert Ptz.History.at(aim, 100) == looks(0.1)
    assert Ptz.History.note(aim, looks(0.9), 100) == aim
    assert Ptz.History.note(aim, looks(0.9, %{age_ms: 500}), 130) == aim
  end

  test "what is kept is bounded, and the last readings stay" do
    aim = track(for k <- 1..1000, do: {k * 100, k / 1000})
    assert length(aim) == 20
    assert Ptz.History.at(aim, 97_000) == nil
    assert_in_delta Ptz.History.at(aim, 99_950).pan, 0.9995, 1.0e-9
  end

  test "a unit that turns as fast as it can, read at 10 Hz: pictures are off by less than held readings" do
    # There and back at 80 degrees/s, with rests.
    pan = fn ms -> max(0.0, min(1.0, abs(rem(ms, 4_000) - 2_000) / 716 - 0.5)) end

    {held, off} =
      Enum.reduce(0..20_000//10, {Ptz.History.new(), []}, fn ms, {aim, off} ->
        aim = if rem(ms, 100) == 0, do: Ptz.History.note(aim, looks(pan.(ms)), ms), else: aim
        # A picture is looked at 60 ms after it was taken.
        at = Ptz.History.at(aim, ms - 60)
        last = aim |> hd() |> elem(1)
        pair = at && {abs(last.pan - pan.(ms - 60)), abs(at.pan - pan.(ms - 60))}
        {aim, if(pair, do: [pair | off], else: off)}
      end)
      |> elem(1)
      |> Enum.unzip()

    mean = fn list -> Enum.sum(list) / length(list) end
    assert mean.(off) < 0.25 * mean.(held)
    assert Enum.max(off) < 0.1
  end
end
