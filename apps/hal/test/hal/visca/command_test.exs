defmodule Hal.Visca.CommandTest do
  use ExUnit.Case, async: true
  alias Hal.Visca.{Command, Reply, Units}
  doctest Hal.Visca.Command
  doctest Hal.Visca.Units
  doctest Hal.Visca.Model

  @degree :math.pi() / 180

  defp hex(text), do: text |> String.replace(" ", "") |> Base.decode16!(case: :lower)

  # Every row of the fact sheet's section 7 that goes to the camera.
  @examples [
    {:address_set, "88 30 01 ff"},
    {:if_clear, "88 01 00 01 ff"},
    {{:ask, :version}, "81 09 00 02 ff"},
    {{:ask, :power}, "81 09 04 00 ff"},
    {{:ask, :position}, "81 09 06 12 ff"},
    {{:ask, :zoom}, "81 09 04 47 ff"},
    {{:look, -264, -108, 24, 20}, "81 01 06 02 18 14 0f 0e 0f 08 0f 0f 09 04 ff"},
    {{:look, -264, -120, 24, 20}, "81 01 06 02 18 14 0f 0e 0f 08 0f 0f 08 08 ff"},
    {{:look, 396, 120, 24, 20}, "81 01 06 02 18 14 00 01 08 0c 00 00 07 08 ff"},
    {{:look, -880, 300, 24, 20}, "81 01 06 02 18 14 0f 0c 09 00 00 01 02 0c ff"},
    {{:look, 880, -300, 24, 20}, "81 01 06 02 18 14 00 03 07 00 0f 0e 0d 04 ff"},
    {{:look, 0, 0, 24, 20}, "81 01 06 02 18 14 00 00 00 00 00 00 00 00 ff"},
    {{:zoom_to, 568}, "81 01 04 47 00 02 03 08 ff"},
    {{:zoom_to, 0}, "81 01 04 47 00 00 00 00 ff"},
    {{:drive, {:left, 6}, {:stop, 0}}, "81 01 06 01 06 00 01 03 ff"},
    {{:drive, {:stop, 0}, {:stop, 0}}, "81 01 06 01 00 00 03 03 ff"},
    {:home, "81 01 06 04 ff"},
    {{:cancel, 1}, "81 21 ff"}
  ]

  # The rest of section 4.
  @others [
    {:if_clear_one, "81 01 00 01 ff"},
    {{:power, true}, "81 01 04 00 02 ff"},
    {{:power, false}, "81 01 04 00 03 ff"},
    {{:zoom, :stop}, "81 01 04 07 00 ff"},
    {{:zoom, :tele}, "81 01 04 07 02 ff"},
    {{:zoom, :wide}, "81 01 04 07 03 ff"},
    {{:zoom, :tele, 2}, "81 01 04 07 22 ff"},
    {{:zoom, :wide, 7}, "81 01 04 07 37 ff"},
    {{:zoom_to, 1023}, "81 01 04 47 00 03 0f 0f ff"},
    {{:focus, :auto}, "81 01 04 38 02 ff"},
    {{:focus, :manual}, "81 01 04 38 03 ff"},
    {{:step, 880, -12, 1, 2}, "81 01 06 03 01 02 00 03 07 00 0f 0f 0f 04 ff"},
    {{:drive, {:right, 24}, {:up, 20}}, "81 01 06 01 18 14 02 01 ff"},
    {{:drive, {:stop, 0}, {:down, 1}}, "81 01 06 01 00 01 03 02 ff"},
    {:reset, "81 01 06 05 ff"},
    {{:limit, :up_right, 880, 300}, "81 01 06 07 00 01 00 03 07 00 00 01 02 0c ff"},
    {{:limit, :down_left, 0, 0}, "81 01 06 07 00 00 00 00 00 00 00 00 00 00 ff"},
    {{:limit_clear, :up_right}, "81 01 06 07 01 01 07 0f 0f 0f 07 0f 0f 0f ff"},
    {{:screen, :on}, "81 01 06 06 02 ff"},
    {{:screen, :off}, "81 01 06 06 03 ff"},
    {{:screen, :toggle}, "81 01 06 06 10 ff"},
    {{:memory, :reset, 0}, "81 01 04 3f 00 00 ff"},
    {{:memory, :set, 5}, "81 01 04 3f 01 05 ff"},
    {{:memory, :recall, 1}, "81 01 04 3f 02 01 ff"},
    {{:ask, :max_speed}, "81 09 06 11 ff"},
    {{:ask, :status}, "81 09 06 10 ff"},
    {{:ask, :screen}, "81 09 06 06 ff"},
    {{:ask, :video}, "81 09 06 23 ff"},
    {{:ask, :focus}, "81 09 04 38 ff"}
  ]

  test "the bytes of the fact sheet's worked examples" do
    for {command, bytes} <- @examples ++ @others,
        do: assert(Command.encode(command, 1) == hex(bytes), inspect(command))
  end

  test "all cameras of the chain are reached, and no 0xFF stands inside a message" do
    for {command, _bytes} <- @examples ++ @others, camera <- 1..7 do
      <<header, body::binary>> = Command.encode(command, camera)
      assert header == if(command in [:address_set, :if_clear], do: 0x88, else: 0x80 + camera)
      assert byte_size(body) in 2..15
      assert :binary.matches(body, <<0xFF>>) == [{byte_size(body) - 1, 1}]
    end
  end

  test "what is not a command, or out of range, is refused by name" do
    for wrong <- [
          {:look, 2268, 0, 24, 20},
          {:look, 0, -401, 24, 20},
          {:look, 0.5, 0, 24, 20},
          {:look, 0, 0, 0, 20},
          {:drive, {:left, 0}, {:stop, 0}},
          {:drive, {:up, 1}, {:stop, 0}},
          {:drive, {:stop, 0}, {:down, 21}},
          {:zoom_to, 0x4001},
          {:cancel, 3},
          {:memory, :set, 6},
          {:ask, :weather},
          :dance
        ] do
      error = assert_raise ArgumentError, fn -> Command.encode(wrong, 1) end
      assert error.message =~ inspect(wrong)
    end

    assert_raise FunctionClauseError, fn -> Command.encode(:home, 8) end
  end

  test "angles become the sheet's numbers, signs included" do
    look = fn pan, tilt -> {Units.pan(pan * @degree), Units.tilt(tilt * @degree)} end
    assert look.(30, -10) == {-264, -120}
    assert look.(30, -9) == {-264, -108}
    assert look.(-45, 10) == {396, 120}
    assert look.(100, 25) == {-880, 300}
    assert look.(-100, -25) == {880, -300}
    assert look.(1.0e300, -1.0e300) == {-880, -300}
  end

  test "each model has its own units, and its own ends" do
    look = fn key, pan, tilt ->
      model = Hal.Visca.Model.get(key)
      {Units.pan(pan * @degree, model), Units.tilt(tilt * @degree, model)}
    end

    # Sony's tables: FA60 and 0168; F725, 04B0 and FE70.
    assert look.(:d100, 100, 25) == {-1440, 360}
    assert look.(:d100, 50, -30) == {-720, -360}
    assert look.(:d70, 170, 90) == {-2267, 1200}
    assert look.(:d70, -999, -999) == {2267, -400}
    assert look.(:d70, 45, 0) == {-600, 0}

    for key <- Hal.Visca.Model.keys(),
        model = Hal.Visca.Model.get(key),
        pan <- [-1.7, -0.3, 0.9] do
      {seen, _} = model |> then(&Units.angles(Units.pan(pan, &1), 0, &1))
      assert abs(seen - pan) <= 0.5 / model.pan_degree * @degree + 1.0e-9
      {tele, wide} = model.lens
      assert Units.zoom(wide, model.lens, model) == 0
      assert Units.zoom(tele, model.lens, model) == model.zoom
    end
  end

  test "what was asked for is read back within half a step, over the whole range" do
    for pan <- -1745..1745//5, tilt <- [-0.43, -0.1, 0.0, 0.2, 0.43] do
      pan = pan / 1000
      {seen, seen_tilt} = Units.angles(Units.pan(pan), Units.tilt(tilt))
      assert abs(seen - pan) <= 0.5 / 8.8 * @degree + 1.0e-9
      assert abs(seen_tilt - tilt) <= 0.5 / 12 * @degree + 1.0e-9
    end
  end

  test "speeds are the sheet's, and a rate below half the slowest is a stop" do
    assert Units.drive(20 * @degree, 0.0) == {:drive, {:left, 6}, {:stop, 0}}
    assert Units.drive(-80 * @degree, 50 * @degree) == {:drive, {:right, 24}, {:up, 20}}
    assert Units.drive(-1.0e300, -0.03) == {:drive, {:right, 24}, {:down, 1}}
    assert Units.drive(0.02, -0.02) == {:drive, {:stop, 0}, {:stop, 0}}

    for n <- 1..24, do: assert(Units.pan_speed(n * 10 / 3 * @degree) == n)
    for n <- 1..20, do: assert(Units.tilt_speed(n * 2.5 * @degree) == n)
  end

  test "the field of view by zoom is the sheet's table" do
    for {zoom, narrow, sony} <- [
          {0, 30.0, 48.8},
          {256, 23.25, 37.7},
          {512, 16.5, 26.6},
          {568, 15.02, 24.17},
          {1023, 3.03, 4.44}
        ] do
      assert_in_delta Units.field_of_view(zoom, {3 * @degree, 30 * @degree}) / @degree,
                      narrow,
                      0.01

      assert_in_delta Units.field_of_view(zoom, {4.4 * @degree, 48.8 * @degree}) / @degree,
                      sony,
                      0.01
    end

    lens = {4.4 * @degree, 48.8 * @degree}
    for z <- 0..1023, do: assert(Units.zoom(Units.field_of_view(z, lens), lens) == z)
    assert Reply.value(:zoom, <<0, 3, 0xF, 0xF>>) == {:ok, 1023}
  end
end
