defmodule Robot.File.EditTest do
  use ExUnit.Case, async: true
  alias Robot.File.{Edit, Reader}
  doctest Robot.File.Edit

  test "numbers are replaced where they stand, whatever stands round them" do
    text = """
    # conversions: [distance: 1]
    [id: :mag1, estop_file: "é conversions: [angle: 2]",
     drive: {Hal.RFlex.Driver, port: "/dev/ttyS1", conversions: [range: 1_474.0, # angle: 3
       distance: -31387.0, angle: - 0x10, bad_angle: 5]}]
    """

    assert {:ok, new} = Edit.conversions(text, angle: 4.5, distance: 6.0, range: 7)

    assert new ==
             text
             |> String.replace("1_474.0", "7")
             |> String.replace("-31387.0", "6.0")
             |> String.replace("- 0x10", "4.5")
  end

  test "numbers that are not there come first, in their order, on lines of their own where there are lines" do
    for {before, behind} <- [
          {"conversions: []", "conversions: [distance: 1.5, angle: 2.5]"},
          {"conversions: [range: 1]", "conversions: [distance: 1.5, angle: 2.5, range: 1]"},
          {"conversions: [range: 1,\n  angle: 2]",
           "conversions: [distance: 1.5, range: 1,\n  angle: 2.5]"},
          {"conversions: [ # units\n  range: 1\n]",
           "conversions: [ # units\n  distance: 1.5,\n  angle: 2.5,\n  range: 1\n]"},
          {"conversions: [\n  # distance: 3\n]",
           "conversions: [\n  distance: 1.5,\n  angle: 2.5\n  # distance: 3\n]"}
        ] do
      assert Edit.conversions("[a: {D, [#{before}]}]", distance: 1.5, angle: 2.5) ==
               {:ok, "[a: {D, [#{behind}]}]"}

      assert {:ok, _tree} = Reader.read("[a: {D, [#{behind}]}]")
    end
  end

  test "what is not a robot file is left alone, and so is a file without the list" do
    assert {:error, "line 2: " <> _} = Edit.conversions("[a: 1\n b: 2]", angle: 1.0)
    assert {:error, line} = Edit.conversions("[a: {D, conversions: 7}]", angle: 1.0)
    assert line == "there is no list conversions: [...] in it"
  end

  test "the robots that come along, with lines of their own" do
    folder = Path.expand("../../../../../config/robots", __DIR__)
    colours = fn file, options -> Vision.Colours.read(Path.join(folder, file), options) end

    for file <- ["mag1.exs", "min1.exs", "template.exs"] do
      text = File.read!(Path.join(folder, file))
      assert {:ok, new} = Edit.conversions(text, distance: 31_000.5, angle: 4700.25)
      assert {:ok, robot} = Robot.File.parse(new, file: file, colours: colours)
      {_driver, options} = robot.drive
      assert options[:conversions][:distance] == 31_000.5
      assert options[:conversions][:angle] == 4700.25
      added = String.split(new, "\n") -- String.split(text, "\n")
      assert length(added) in 1..2
    end
  end
end
