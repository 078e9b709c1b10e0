defmodule Vision.ColoursTest do
  use ExUnit.Case, async: true
  doctest Vision.Colours
  doctest Vision.Colours.Line
  alias Vision.Colours

  @good """
  # a comment before any section is skipped
  [Colors]
  (255,255,0) 0.500000 10 YellowLandmark
  ( 255, 0, 0) 1 1 RedRobot

  [Unknown]
  [Thresholds]
  (170:240, 60: 90,130:145)
  (20:170,80:120,150:240)
  """

  defp error(text), do: text |> Colours.parse(file: "f") |> elem(1)

  test "reads classes in order, with display colour and limits" do
    assert {:ok, %Colours{classes: [yellow, red], min_area: 20, max_area: 0}} =
             Colours.parse(@good)

    assert yellow == %{
             name: "YellowLandmark",
             rgb: {255, 255, 0},
             merge: 0.5,
             expected: 10,
             y: {170, 240},
             u: {60, 90},
             v: {130, 145},
             distance: nil
           }

    assert {red.name, red.merge, red.v} == {"RedRobot", 1.0, {150, 240}}
  end

  test "headers in any case, lines ended by CR LF, no last line end" do
    text =
      @good |> String.upcase() |> String.replace("\n", "\r\n") |> String.trim_trailing("\r\n")

    assert {:ok, %Colours{classes: [%{name: "YELLOWLANDMARK"}, _red]}} = Colours.parse(text)
  end

  test "the tables hold each class's bit within its limits only" do
    {:ok, colours} = Colours.parse(@good)
    assert Colours.mask(colours, {170, 60, 130}) == 0b01
    assert Colours.mask(colours, {240, 90, 145}) == 0b01
    assert Colours.mask(colours, {241, 90, 145}) == 0
    assert Colours.mask(colours, {170, 59, 130}) == 0
    assert Colours.mask(colours, {20, 120, 240}) == 0b10
  end

  test "32 classes are read, the last has the highest bit; 33 are not" do
    {:ok, colours} = many(32) |> Colours.parse()
    assert Colours.mask(colours, {31, 1, 1}) == 0x80000000
    assert error(many(33)) == "f: expected 1 to 32 colours, got 33"
  end

  test "a missing blank line is told as such" do
    text = String.replace(@good, "\n\n[Unknown]", "")

    assert error(text) ==
             "f:5: the [Thresholds] header needs a blank line before it, or it is taken for the end of [Colors]"
  end

  test "a header that was taken for an end does no harm when it comes again" do
    assert {:ok, _} =
             @good |> String.replace("\n\n[Unknown]\n", "\n[Thresholds]\n") |> Colours.parse()
  end

  test "numbers as C reads them" do
    text = String.replace(@good, ") 0.500000 10 ", ").5 +10 ")
    assert {:ok, %{classes: [%{merge: 0.5, expected: 10}, _]}} = Colours.parse(text)
    assert {:ok, _} = @good |> String.replace(" 1 1 ", " 1. 1 ") |> Colours.parse()
  end

  test "a colour without a name is none, and no number is read twice" do
    for line <- [
          "(255,255,0) 0.5 10",
          "(255,255,0) 0.5 10   ",
          "(255,255,0) 0.5 10 # the landmark",
          "(255,255,0) 0.5 Yellow",
          "(255,255,0) 10",
          "(255,255,0)",
          "(255,255,0 0.5 10 Yellow",
          "(255,255,0) . 10 Yellow",
          "(255,255,0) 0.5.5 10 Yellow",
          "(2 55,255,0) 0.5 10 Yellow"
        ] do
      text = String.replace(@good, "(255,255,0) 0.500000 10 YellowLandmark", line)

      assert error(text) ==
               "f:3: #{inspect(line)} is not of the form (R,G,B) merge expected Name " <>
                 "with R, G, B from 0 to 255"
    end

    for limits <- ["(170:240, 60: 90,130:14 5)", "(170:240,60:90,130:145", "(170:240,60:90,130:)"] do
      text = String.replace(@good, "(170:240, 60: 90,130:145)", limits)
      assert error(text) =~ "f:8: #{inspect(limits)} is not of the form (Ylo:Yhi"
    end
  end

  test "what C reads is read: no blank before a name, remarks behind a line, exponents" do
    for line <- [
          "(255,255,0) 5e-1 10YellowLandmark",
          "(255,255,0)0.5\t10 YellowLandmark # the landmark",
          "( 255,\t255, 0 ) 0.5 10 YellowLandmark"
        ] do
      text = String.replace(@good, "(255,255,0) 0.500000 10 YellowLandmark", line)

      assert {:ok, %{classes: [%{name: "YellowLandmark", merge: 0.5, expected: 10}, _]}} =
               Colours.parse(text)
    end
  end

  test "two colours of one name are refused, in a file and without one" do
    assert error(String.replace(@good, "RedRobot", "YellowLandmark")) ==
             "f:4: a second colour is named YellowLandmark: each needs a name of its own"

    red = %{name: "Red", y: {20, 170}, u: {80, 120}, v: {150, 240}}
    assert {:error, "two colours are named Red" <> _} = Colours.new([red, %{red | y: {1, 2}}])
  end

  test "limits out of range, the wrong way round or broken are named" do
    for {limits, said} <- [
          {"(-5:240,60:90,130:145)",
           "f:8: threshold Y: expected 0 to 255, the lower number first, got -5:240"},
          {"(170:240,60:300,130:145)",
           "f:8: threshold U: expected 0 to 255, the lower number first, got 60:300"},
          {"(170:240,60:90,145:130)",
           "f:8: threshold V: expected 0 to 255, the lower number first, got 145:130"},
          {"(170:abc,60:90,130:145)",
           "f:8: \"(170:abc,60:90,130:145)\" is not of the form (Ylo:Yhi"}
        ] do
      text = String.replace(@good, "(170:240, 60: 90,130:145)", limits)
      assert error(text) =~ said
      assert error(text) |> String.split("\n") |> length() == 1
    end
  end

  test "thresholds missing or left over say which line ended a section" do
    assert error(String.replace(@good, "(20:170,80:120,150:240)\n", "")) =~
             "f: 2 colours but 1 thresholds: one line each is needed; [Colors] ended at line 5"

    assert error(String.replace(@good, "\n( 255", "\n# red\n( 255")) =~ "[Colors] ended at line 4"
  end

  test "other wrong files" do
    assert error("") =~ "f: is empty"
    assert error("hello\nworld\n") =~ "f: no colours found"
    assert error(<<0, 255, 17, 3>>) == "f: not a text file"
    assert error(@good <> "\n[Colors]\n") == "f:11: expected one [Colors] section, got a second"
    assert error(String.duplicate("x", 300)) == "f:1: expected at most 255 bytes, got 300"

    assert error(String.replace(@good, "(255,255,0)", "(256,255,0)")) =~
             "f:3: the colour YellowLandmark"

    assert error(String.replace(@good, "(255,255,0)", "(255,255)")) =~
             "is not of the form (R,G,B)"

    assert Colours.read("/") == {:error, "/: illegal operation on a directory"}
  end

  test "options are checked" do
    assert {:error,
            "colour file: distance for Blue, but the colours are YellowLandmark, RedRobot"} =
             Colours.parse(@good, distance: %{"Blue" => 1.0})

    assert {:error, "colour file: distance for RedRobot: expected " <> _} =
             Colours.parse(@good, distance: %{"RedRobot" => 0})

    assert {:error, "colour file: min_area: expected whole numbers from 1, got 0"} =
             Colours.parse(@good, min_area: 0)

    assert {:error, _} = Colours.parse(@good, max_area: -1)
    assert {:error, _} = Colours.parse(@good, min_area: 2.5)

    assert {:error, "colour file: backend: expected a Vision.Backend, got Hal.Pose"} =
             Colours.parse(@good, backend: Hal.Pose)
  end

  defp many(n) do
    colours = for k <- 1..n, do: "(1,2,3) 0.5 1 C#{k}\n"
    limits = for k <- 1..n, do: "(#{k - 1}:#{k - 1},0:9,0:9)\n"
    "[Colors]\n#{colours}\n[Thresholds]\n#{limits}"
  end
end
