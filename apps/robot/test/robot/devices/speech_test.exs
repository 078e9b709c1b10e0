defmodule Robot.Devices.SpeechTest do
  @moduledoc "What a robot says aloud, by a program that writes down what it is told."
  use Robot.Case, async: false
  import ExUnit.CaptureLog
  alias Robot.Devices.Speech
  @moduletag :realtime
  @moduletag :tmp_dir

  doctest Speech
  doctest Robot.Config.Speech

  defp program(folder, script) do
    path = Path.join(folder, "say")
    File.write!(path, "#!/bin/sh\n" <> script <> "\n")
    File.chmod!(path, 0o755)
    path
  end

  defp said(folder) do
    case File.read(Path.join(folder, "said")) do
      {:ok, text} -> String.split(text, "\n", trim: true)
      {:error, :enoent} -> []
    end
  end

  defp stage(id, stage),
    do: Hal.Event.execute([:robot, :stage], %{at_ms: 0}, %{robot: id, stage: stage})

  defp await(true?, left \\ 400) do
    cond do
      true?.() -> :ok
      left == 0 -> flunk("in vain")
      true -> receive(do: (:never -> :ok), after: (25 -> await(true?, left - 1)))
    end
  end

  test "it says the events that its file names, of this robot alone", %{tmp_dir: folder} do
    say = program(folder, ~s(echo "$*" >> "#{folder}/said"))
    robot(:talks1, say: [events: ["formed", "estop"], program: say, voice: "de"])
    stage(:talks1, :elected)
    stage(:talks2, :formed)
    stage(:talks1, :formed)
    await(fn -> said(folder) == ["-v de -- talks1: formed"] end)
    :ok = Gate.estop(:talks1)
    await(fn -> said(folder) == ["-v de -- talks1: formed", "-v de -- talks1: estop"] end)
  end

  test "while it speaks only the newest waits", %{tmp_dir: folder} do
    say =
      program(folder, """
      echo "$4" >> "#{folder}/said"
      while [ ! -e "#{folder}/go" ]; do sleep 0.05; done
      """)

    robot(:talks3, say: [events: ["elected", "formed", "lost"], program: say])
    stage(:talks3, :elected)
    await(fn -> said(folder) == ["talks3: elected"] end)
    for stage <- [:formed, :lost], do: stage(:talks3, stage)
    _heard = :talks3 |> Names.whereis(:speech) |> :sys.get_state()
    File.write!(Path.join(folder, "go"), "")
    await(fn -> said(folder) == ["talks3: elected", "talks3: lost"] end)
  end

  test "a program that is missing is one line, and the robot goes on", %{tmp_dir: folder} do
    id = robot(:talks4, say: [events: ["formed"], program: Path.join(folder, "none")])

    log =
      capture_log(fn ->
        for _n <- 1..3, do: stage(id, :formed)
        _heard = id |> Names.whereis(:speech) |> :sys.get_state()
      end)

    assert [_before, _once] = String.split(log, "talks4: nothing is said: ")
    assert log =~ "none is not installed"
    assert Names.whereis(id, :speech)
  end

  test "a wrong option is one line" do
    assert {:error, line} =
             Robot.Config.new(
               id: :talks5,
               profile: Hal.Profile.magellan(),
               drive: {Some.Drive, []},
               say: [events: [:formed]]
             )

    assert line =~ "say.events.1: expected the name of a stage"
  end
end
