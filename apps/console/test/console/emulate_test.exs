defmodule Console.EmulateTest do
  @moduledoc "The emulator as a person starts it: a real driver finds the base on its link, and drives its body."
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.Emulate
  alias Hal.{Device, Twist}
  @moduletag :tmp_dir
  @moduletag :realtime

  test "what is wrong is one line", %{tmp_dir: folder} do
    file = Path.join(folder, "file")
    File.write!(file, "")

    for {arguments, line} <- [
          {[], "which body? such as bin/emulate rflex --link base"},
          {~w(rflex), "--link is missing: the file by which the base's line is found"},
          {~w(rflex mag --link a), "one body at a time, not mag too"},
          {~w(unicorn --link a),
           "unicorn is no body that can be emulated; bin/emulate --help names some"},
          {["mag", "--link", file], "--link #{file} is there already, and is no link"}
        ],
        do: assert({:error, line} == Emulate.run(arguments, folder))

    assert {:error, [line]} = Emulate.run(~w(mag --link a --map nowhere), folder)
    assert line =~ "--map"

    assert capture_io(fn -> Emulate.run(~w(--help), folder) end) =~
             "bin/emulate burger --link tb3"
  end

  test "a driver drives the body, and the lines say what the wheels do", %{tmp_dir: folder} do
    test = self()
    {:ok, said} = StringIO.open("")

    spawn_link(fn ->
      Process.group_leader(self(), said)
      send(test, {:ended, Emulate.run(~w(kobuki --link base), folder)})
    end)

    link = Path.join(folder, "base")
    await(fn -> File.exists?(link) end)

    {:ok, drive} =
      Device.start_link(
        kind: :drive,
        driver: {Hal.Kobuki.Driver, port: link},
        sinks: []
      )

    drives = fn ->
      Device.drive(drive, Twist.new(0.2, 0))
      said |> StringIO.contents() |> elem(1) =~ "wheels 0.20 m/s, 0.00 rad/s"
    end

    await(drives)
    refute_received {:ended, _status}
  end

  defp await(done?, left \\ 200) do
    cond do
      done?.() -> :ok
      left == 0 -> flunk("waited in vain")
      true -> receive(do: (:never -> :ok), after: (50 -> await(done?, left - 1)))
    end
  end
end
