defmodule Robot.ConfigTest do
  use ExUnit.Case, async: true
  doctest Robot.Config
  doctest Robot.Names

  @good [id: :mag1, profile: Hal.Profile.magellan(), drive: {Some.Drive, []}]

  test "each wrong option is named, in one line, with what is allowed" do
    for {option, value} <- [
          id: nil,
          id: "mag1",
          profile: :magellan,
          drive: Some.Drive,
          drive: nil,
          ptz: {Some.Ptz, :fast},
          camera: "/dev/video0",
          start: {0, 0},
          colours: "colours.txt",
          limits: [max_linear: :fast],
          limits: [wheels: 3.0],
          limits: [max_linear: -0.1],
          limits: [max_linear: 5.0],
          mission: Some.Mission,
          companions: [Some.Link],
          send: &send/2,
          clock: nil,
          pace: :fast,
          estop_file: :file,
          trace: self()
        ] do
      assert {:error, line} = Robot.Config.new(Keyword.put(@good, option, value))

      assert line =~
               ~r/^robot option #{option}[^ ]* (is not known: allowed are)|^robot option #{option}[^ ]*: expected .*, got /

      refute line =~ "\n"

      assert_raise ArgumentError, line, fn ->
        Robot.Config.new!(Keyword.put(@good, option, value))
      end
    end
  end

  test "a robot with a camera must know colours" do
    assert {:error, line} = Robot.Config.new(@good ++ [camera: {Some.Camera, []}])
    assert line =~ "option colours"
  end

  test "what is missing is named" do
    assert {:error, line} = Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan())
    assert line =~ "option drive is missing: expected {module, options}"
  end

  defmodule Slow do
    def sonar_round_s(options), do: options[:round]
  end

  test "the body knows how long its driver's sonars take for a round" do
    config = fn drive ->
      Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan(), drive: drive)
    end

    round = fn drive ->
      assert {:ok, %{profile: profile}} = config.(drive)
      profile.sonar_round_s
    end

    assert round.({Some.Drive, []}) == 0.0
    assert round.({Hal.RFlex.Driver, [port: "/dev/ttyR0"]}) == 0.59375
    assert round.({Slow, [round: 1.5]}) == 1.5

    for wrong <- [nil, -0.1, 2.1, 1, "1.0"] do
      assert {:error, line} = config.({Slow, [round: wrong]})
      assert line =~ "expected 0.0 to 2.0 s for a round of its sonars, got #{inspect(wrong)}"
    end

    slow = [port: "/dev/ttyR0", sonar_times: {1_000_000, 1_000_000, 0}]

    assert {:error,
            "robot option drive: expected 0.0 to 2.0 s for a round of its sonars, got 38.0" <> _} =
             config.({Hal.RFlex.Driver, slow})
  end
end
