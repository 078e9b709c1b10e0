defmodule Console.Cli.OutFileTest do
  use ExUnit.Case, async: true
  alias Console.Cli.OutFile
  @moduletag :tmp_dir

  test "a file is replaced whole, by way of another one that is gone afterwards", %{tmp_dir: tmp} do
    path = Path.join(tmp, "report.json")
    assert OutFile.check("--json", path) == :ok
    assert File.ls!(tmp) == []
    assert OutFile.write("--json", path, ["o", "ld"]) == :ok
    assert OutFile.check("--json", path) == :ok
    assert File.read!(path) == "old"
    assert OutFile.write("--json", path, "new") == :ok
    assert File.read!(path) == "new"
    assert File.ls!(tmp) == ["report.json"]
  end

  test "a file of the user's beside it is left alone", %{tmp_dir: tmp} do
    path = Path.join(tmp, "report.json")
    File.write!(path <> ".part", "mine")
    assert OutFile.check("--json", path) == :ok
    assert OutFile.write("--json", path, "new") == :ok
    assert File.read!(path <> ".part") == "mine"
  end

  test "a link stays one, and its file is replaced", %{tmp_dir: tmp} do
    [path, link] = for name <- ["file", "link"], do: Path.join(tmp, name)
    File.write!(path, "old")
    File.ln_s!("file", link)
    assert OutFile.write("--json", link, "new") == :ok
    assert File.read_link(link) == {:ok, "file"}
    assert File.read!(path) == "new"
  end

  test "where nothing can be written, that is said before, and after", %{tmp_dir: tmp} do
    for path <- ["/proc/report.json", Path.join(tmp, "none/report.json"), tmp] do
      assert {:error, line} = OutFile.check("--json", path)
      assert line =~ ~r/^--json #{Regex.escape(path)} cannot be written: [a-z ]+$/
      assert {:error, ^line} = OutFile.write("--json", path, "text")
    end

    assert File.ls!(tmp) == []
  end

  test "a device is written directly, and a full one is an error" do
    assert OutFile.check("--json", "/dev/null") == :ok
    assert OutFile.write("--json", "/dev/null", "text") == :ok

    assert OutFile.write("--json", "/dev/full", "text") ==
             {:error, "--json /dev/full cannot be written: no space left on device"}
  end
end
