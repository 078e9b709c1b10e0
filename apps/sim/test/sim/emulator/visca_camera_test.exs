defmodule Sim.Emulator.ViscaCameraTest do
  @moduledoc "Tests the emulated camera against the fact sheet, and with noise."
  use ExUnit.Case, async: true
  alias Sim.Emulator.ViscaCamera, as: Camera
  doctest Sim.Emulator.ViscaCamera.Commands
  doctest Sim.Emulator.ViscaCamera.Options
  doctest Sim.Emulator.ViscaCamera.Packet

  defp hex(text), do: text |> String.replace(" ", "") |> Base.decode16!(case: :lower)

  defp text(bytes) do
    for <<byte <- bytes>>, into: "", do: " " <> Base.encode16(<<byte>>, case: :lower)
  end

  defp camera(options \\ []) do
    {:ok, camera} = Camera.new(options, 0)
    camera
  end

  defp hear(camera, text, at_ms), do: Camera.hear(camera, hex(text), at_ms)

  defp told(camera, at_ms) do
    {bytes, _wishes, camera} = Camera.run(camera, at_ms)
    {bytes |> IO.iodata_to_binary() |> text() |> String.trim_leading(), camera}
  end

  # All answers until nothing more happens by itself, with the time of each.
  defp until_quiet(camera, at_ms, answers \\ []) do
    {text, camera} = told(camera, at_ms)
    answers = if text == "", do: answers, else: answers ++ [{at_ms, text}]

    case Camera.next_ms(camera) do
      nil -> {answers, camera}
      next_ms when next_ms > at_ms -> until_quiet(camera, next_ms, answers)
    end
  end

  defp place(camera, at_ms) do
    {text, _camera} = camera |> hear("81 09 06 12 ff", at_ms) |> told(at_ms + 16)
    <<0x90, 0x50, rest::binary-size(8), 0xFF>> = text |> hex() |> last_packet()
    <<pan::binary-size(4), tilt::binary-size(4)>> = rest
    {:ok, pan} = Sim.Emulator.ViscaCamera.Packet.number(pan)
    {:ok, tilt} = Sim.Emulator.ViscaCamera.Packet.number(tilt)
    {pan, tilt}
  end

  defp last_packet(bytes),
    do: (bytes |> :binary.split(<<0xFF>>, [:global, :trim]) |> List.last()) <> <<0xFF>>

  @answered [
    {"88 30 01 ff", "88 30 02 ff"},
    {"88 01 00 01 ff", "88 01 00 01 ff"},
    {"81 01 00 01 ff", "90 50 ff"},
    {"81 09 00 02 ff", "90 50 00 20 04 02 01 00 02 ff"},
    {"81 09 04 00 ff", "90 50 02 ff"},
    {"81 09 06 12 ff", "90 50 00 00 00 00 00 00 00 00 ff"},
    {"81 09 04 47 ff", "90 50 00 00 00 00 ff"},
    {"81 09 06 11 ff", "90 50 18 14 ff"},
    {"81 09 06 06 ff", "90 50 03 ff"},
    {"81 09 04 38 ff", "90 50 02 ff"},
    {"81 09 06 23 ff", "90 50 01 ff"},
    {"81 21 ff", "90 61 05 ff"},
    {"81 01 06 99 ff", "90 60 02 ff"},
    {"81 09 99 99 ff", "90 60 02 ff"},
    {"81 42 ff", "90 60 02 ff"},
    {"81 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d 0e 0f ff", "90 60 01 ff"},
    # To another camera, from another camera, and rubbish.
    {"82 09 04 00 ff", ""},
    {"90 41 ff", ""},
    {"ff ff 01 06 04 ff", ""}
  ]

  for {said, answer} <- @answered do
    test "worked example: #{said} is answered by #{if answer == "", do: "nothing", else: answer}" do
      camera = hear(camera(), unquote(said), 0)
      assert {"", camera} = told(camera, 15)
      assert {unquote(answer), camera} = told(camera, 16)
      assert Camera.next_ms(camera) == nil
    end
  end

  @ways [
    {"81 01 06 02 18 14 0f 0e 0f 08 0f 0f 09 04 ff", {-264, -108}},
    {"81 01 06 02 18 14 0f 0e 0f 08 0f 0f 08 08 ff", {-264, -120}},
    {"81 01 06 02 18 14 00 01 08 0c 00 00 07 08 ff", {396, 120}},
    {"81 01 06 02 18 14 0f 0c 09 00 00 01 02 0c ff", {-880, 300}},
    {"81 01 06 02 18 14 00 03 07 00 0f 0e 0d 04 ff", {880, -300}},
    {"81 01 06 02 18 14 00 00 00 00 00 00 00 00 ff", {0, 0}}
  ]

  for {said, {pan, tilt}} <- @ways do
    test "worked example: #{said} goes to #{pan}, #{tilt} as fast as its speed says" do
      {answers, camera} = camera() |> hear(unquote(said), 0) |> until_quiet(0)
      # 3.33 degrees a second for each number, 2.5 of tilt.
      way_ms =
        ceil(1000 * max(abs(unquote(pan)) / 8.8 / (24 * 3.33), abs(unquote(tilt)) / 12 / 50))

      if way_ms == 0 do
        assert answers == [{16, "90 41 ff 90 51 ff"}]
      else
        assert [{16, "90 41 ff"}, {done_ms, "90 51 ff"}] = answers
        assert_in_delta done_ms, way_ms + 16, 2
      end

      assert place(camera, 9000) == {unquote(pan), unquote(tilt)}
    end
  end

  test "the body is told where it looks, left and up positive, at the speed it turns" do
    camera = hear(camera(), "81 01 06 02 18 14 0f 0e 0f 08 0f 0f 08 08 ff", 0)
    {_, [{:look, pan, tilt}, {:zoom, _}], camera} = Camera.run(camera, 100)
    assert_in_delta pan, 0.1 * 24 * 3.33 * :math.pi() / 180, 1.0e-6
    assert_in_delta tilt, -0.1 * 50 * :math.pi() / 180, 1.0e-6
    {_, _, camera} = Camera.run(camera, 1000)
    {_, [{:look, pan, tilt}, {:zoom, _}], _} = Camera.run(camera, 1200)
    assert_in_delta pan, 30 * :math.pi() / 180, 1.0e-6
    assert_in_delta tilt, -10 * :math.pi() / 180, 1.0e-6
  end

  test "two commands run at a time, each with its socket; a third finds none" do
    camera =
      camera()
      |> hear("81 01 06 02 18 14 0f 0e 0f 08 0f 0f 09 04 ff", 0)
      |> hear("81 01 04 47 00 02 03 08 ff", 0)
      |> hear("81 01 04 38 03 ff", 0)

    assert {"90 41 ff 90 42 ff 90 60 03 ff", camera} = told(camera, 16)
    # Inquiries are answered all the time.
    assert {"90 50 02 ff", camera} = camera |> hear("81 09 04 00 ff", 20) |> told(36)
    {answers, camera} = until_quiet(camera, 40)
    assert [{_, "90 51 ff"}, {zoomed_ms, "90 52 ff"}] = answers
    assert_in_delta zoomed_ms, 16 + 2000 * 568 / 1023, 2
    assert {"90 50 00 02 03 08 ff", _} = camera |> hear("81 09 04 47 ff", 5000) |> told(5016)
  end

  test "a second move replaces the first, and both are completed when it ends" do
    camera =
      camera()
      |> hear("81 01 06 02 18 14 0f 0c 09 00 00 00 00 00 ff", 0)
      |> hear("81 01 06 02 18 14 00 00 01 00 00 00 00 00 ff", 500)

    {answers, camera} = until_quiet(camera, 500)
    assert List.last(answers) |> elem(1) == "90 51 ff 90 52 ff"
    assert place(camera, 9000) == {16, 0}
  end

  test "a drive goes on until it is stopped or at its end, and does not interrupt a move" do
    camera = hear(camera(), "81 01 06 01 06 00 01 03 ff", 0)
    assert {"90 41 ff 90 51 ff", camera} = told(camera, 16)
    camera = hear(camera, "81 01 06 01 00 00 03 03 ff", 1000)
    {pan, 0} = place(camera, 1500)
    assert_in_delta pan, -6 * 3.33 * 8.8, 1
    camera = hear(camera, "81 01 06 01 18 14 01 01 ff", 2000)
    assert place(camera, 9000) == {-880, 300}
    camera = hear(camera, "81 01 06 01 00 00 03 03 ff", 9_100)
    # A move home, and a drive meanwhile.
    {_, camera} = told(camera, 9_200)
    camera = camera |> hear("81 01 06 04 ff", 9_200) |> hear("81 01 06 01 18 14 02 03 ff", 9_300)
    assert {"90 41 ff 90 62 41 ff", camera} = told(camera, 9_320)
    {answers, camera} = until_quiet(camera, 9_400)
    assert [{_, "90 51 ff"}] = answers
    assert place(camera, 20_000) == {0, 0}
  end

  test "a cancelled move stops where it is, and is never completed" do
    camera =
      camera()
      |> hear("81 01 06 02 18 14 0f 0c 09 00 00 00 00 00 ff", 0)
      |> hear("81 21 ff", 1000)

    assert {"90 41 ff 90 61 04 ff", camera} = told(camera, 1016)
    assert Camera.next_ms(camera) == nil
    {pan, 0} = place(camera, 5000)
    assert_in_delta pan, -24 * 3.33 * 8.8, 1
    camera = hear(camera, "81 01 06 01 06 00 01 03 ff", 6000)
    assert {"90 41 ff 90 51 ff", _} = told(camera, 6016)
  end

  test "a relative move, and one with limits" do
    camera = hear(camera(), "81 01 06 03 18 14 00 00 06 04 0f 0f 0f 0c ff", 0)
    assert place(camera, 5000) == {100, -4}
    camera = hear(camera, "81 01 06 03 18 14 00 00 06 04 0f 0f 0f 0c ff", 6000)
    assert place(camera, 9000) == {200, -8}
    camera = camera |> hear("81 01 06 07 00 01 00 00 06 04 00 00 00 0a ff", 9000)
    camera = camera |> hear("81 01 06 02 18 14 00 03 07 00 00 01 02 0c ff", 9100)
    assert place(camera, 20_000) == {100, 10}
    camera = camera |> hear("81 01 06 07 01 01 07 0f 0f 0f 07 0f 0f 0f ff", 20_100)
    camera = camera |> hear("81 01 06 02 18 14 00 03 07 00 00 01 02 0c ff", 20_200)
    assert place(camera, 30_000) == {880, 300}
  end

  test "reset goes to both stops and comes back" do
    {answers, camera} = camera() |> hear("81 01 06 05 ff", 0) |> until_quiet(0)
    assert [{16, "90 41 ff"}, {done_ms, "90 51 ff"}] = answers
    # 100, 200 and 100 degrees.
    assert_in_delta done_ms, 16 + 400 / (24 * 3.33) * 1000, 3
    assert place(camera, 9000) == {0, 0}
  end

  test "places are remembered" do
    camera =
      camera()
      |> hear("81 01 06 02 18 14 00 00 06 04 0f 0f 0f 0c ff", 0)
      |> hear("81 01 04 47 00 01 00 00 ff", 5000)
      |> hear("81 01 04 3f 01 02 ff", 9000)
      |> hear("81 01 06 04 ff", 9100)
      |> hear("81 01 04 3f 02 02 ff", 20_000)

    assert place(camera, 30_000) == {100, -4}
    assert {"90 60 02 ff", _} = camera() |> hear("81 01 04 3f 01 06 ff", 0) |> told(16)
  end

  test "zoom by hand, and invalid zoom commands" do
    camera = hear(camera(zoom_ms: 1000), "81 01 04 07 27 ff", 0) |> hear("81 01 04 07 00 ff", 500)
    {answer, camera} = camera |> hear("81 09 04 47 ff", 600) |> told(616)
    <<_::binary-size(2), rest::binary-size(4), 0xFF>> = answer |> hex() |> last_packet()
    {:ok, zoom} = Sim.Emulator.ViscaCamera.Packet.number(rest)
    assert_in_delta zoom, 511, 2

    assert {"90 60 02 ff", camera} =
             camera |> hear("81 01 04 47 00 04 00 00 ff", 700) |> told(716)

    assert {"90 60 02 ff", camera} =
             camera |> hear("81 01 04 47 10 00 00 00 ff", 800) |> told(816)

    assert {"90 60 02 ff", _} =
             camera |> hear("81 01 06 02 19 14 00 00 00 00 00 00 00 00 ff", 900) |> told(916)
  end

  test "if it is switched off it says so, and it takes its time to start" do
    camera = hear(camera(power_on_ms: 700), "81 01 04 00 03 ff", 0)
    assert {"90 41 ff 90 51 ff", camera} = told(camera, 16)
    assert {"90 50 03 ff", camera} = camera |> hear("81 09 04 00 ff", 100) |> told(116)
    assert {"90 61 41 ff", camera} = camera |> hear("81 01 06 04 ff", 200) |> told(216)
    assert {"90 60 41 ff", camera} = camera |> hear("81 09 06 12 ff", 300) |> told(316)
    {answers, camera} = camera |> hear("81 01 04 00 02 ff", 400) |> until_quiet(400)
    assert answers == [{416, "90 41 ff"}, {1116, "90 51 ff"}]
    assert {"90 50 02 ff", _} = camera |> hear("81 09 04 00 ff", 2000) |> told(2016)
  end

  test "when power comes back it announces itself, and looks ahead" do
    camera =
      camera() |> hear("81 01 06 02 18 14 0f 0c 09 00 00 00 00 00 ff", 0) |> Camera.restart(1000)

    assert {"90 38 ff", camera} = told(camera, 1016)
    assert Camera.next_ms(camera) == nil
    assert place(camera, 2000) == {0, 0}
    assert camera(announce: false) |> Camera.restart(0) |> Camera.next_ms() == nil
  end

  test "clearing frees both sockets, and their jobs are never completed" do
    camera = camera() |> hear("81 01 06 02 18 14 0f 0c 09 00 00 00 00 00 ff", 0)
    {_, camera} = told(camera, 16)
    {answers, _} = camera |> hear("88 01 00 01 ff", 100) |> until_quiet(100)
    assert answers == [{116, "88 01 00 01 ff"}]
  end

  test "answers can get lost" do
    camera =
      for k <- 1..1000,
          reduce: camera(drop: 0.1),
          do: (camera -> hear(camera, "81 09 04 00 ff", k))

    {bytes, _, _} = Camera.run(camera, 5000)
    assert_in_delta IO.iodata_length(bytes) / 4, 900, 40
  end

  test "packets may arrive in any pieces; ten thousand random buffers leave nothing behind, and crash nothing" do
    packet = hex("81 01 06 02 18 14 0f 0e 0f 08 0f 0f 08 08 ff")

    for split <- 0..byte_size(packet) do
      {a, b} = :erlang.split_binary(packet, split)
      {text, _} = camera() |> Camera.hear(a, 0) |> Camera.hear(b, 5) |> told(30)
      assert text == "90 41 ff"
    end

    :rand.seed(:exsss, {3, 2, 1})

    for k <- 1..10_000, reduce: camera() do
      camera ->
        bytes =
          for _ <- 1..:rand.uniform(30),
              into: <<>>,
              do:
                <<Enum.random([0x81, 0x01, 0x06, 0x04, 0x09, 0x21, 0xFF, :rand.uniform(256) - 1])>>

        camera = Camera.hear(camera, bytes, 20 * k)
        assert byte_size(camera.buffer) <= 16
        {_bytes, _wishes, camera} = Camera.run(camera, 20 * k)
        camera
    end
  end

  test "invalid options are named" do
    for {option, value} <- [latency_ms: -1, power: 5, drop: 2, zoom_ms: 0, nonsense: 1] do
      assert {:error, line} = Camera.new([{option, value}], 0)
      assert line =~ ~r/option #{option}[: ]/
    end
  end
end
