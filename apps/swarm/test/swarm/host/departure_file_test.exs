defmodule Swarm.Host.DepartureFileTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureLog
  alias Robot.Departure
  alias Swarm.Host.DepartureFile

  doctest DepartureFile

  test "a person's start deletes what was noted, systemd's does not, and a missing folder is made" do
    folder =
      Path.join(
        System.tmp_dir!(),
        "convoy_departure_#{System.pid()}_#{System.unique_integer([:positive])}"
      )

    on_exit(fn -> File.rm_rf!(folder) end)
    path = Path.join(folder, "mag1.departed")
    assert DepartureFile.prepare(nil) == nil
    assert DepartureFile.prepare({path, :person}) == path
    assert Departure.Note.write(path, "a frame") == :ok
    assert DepartureFile.prepare({path, :service}) == path
    assert Departure.Note.read(path) == "a frame"
    assert DepartureFile.prepare({path, :person}) == path
    assert Departure.Note.read(path) == nil

    File.mkdir_p!(path)

    assert capture_log(fn -> DepartureFile.prepare({path, :person}) end) =~
             "#{path} cannot be deleted"
  end
end
