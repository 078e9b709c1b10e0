defmodule Mix.Tasks.Fleet.CertsTest do
  use Hal.TaskCase, async: false
  alias Mix.Tasks.Fleet.Certs, as: CertsTask

  unless System.find_executable("openssl"), do: @moduletag(skip: "openssl is missing")

  test "makes a CA and robots, keeps what is there, adds a robot by the same CA", %{tmp_dir: tmp} do
    out = Path.join(tmp, "certs")
    list = Path.join(tmp, "fleet")
    File.write!(list, "mag2 # the second\n\n# none\n")
    CertsTask.run(["mag1", "--fleet", list, "--out", out])
    assert said() == ["#{out}/ca.pem made", "#{out}/mag1 made", "#{out}/mag2 made"]
    before = File.read!("#{out}/mag1/key.pem")
    CertsTask.run(["mag1", "min1", "--out", out])
    assert said() == ["#{out}/ca.pem kept", "#{out}/mag1 kept", "#{out}/min1 made"]
    assert File.read!("#{out}/mag1/key.pem") == before
    CertsTask.run(["mag1", "--force", "--out", out])
    assert File.read!("#{out}/mag1/key.pem") != before

    for file <- ["ca-key.pem", "mag1/key.pem", "min1/key.pem"],
        do: assert({:ok, %File.Stat{mode: 0o100600}} = File.stat(Path.join(out, file)))

    assert Enum.sort(File.ls!("#{out}/mag1")) == ~w(ca.pem cert.pem key.pem ssl_dist.conf)

    for robot <- ~w(mag1 mag2 min1) do
      words = ["verify", "-CAfile", "#{out}/ca.pem", "#{out}/#{robot}/cert.pem"]
      assert {_text, 0} = System.cmd("openssl", words, stderr_to_stdout: true)
    end
  end

  test "wrong words are one line, and nothing is made", %{tmp_dir: tmp} do
    out = Path.join(tmp, "certs")

    assert refusal(CertsTask, ["--out", out]) ==
             "robots are missing: give their names, or --fleet FILE"

    assert refusal(CertsTask, ["--colour"]) ==
             "fleet.certs: unknown option --colour; known are --fleet, --out, --force, --help"

    assert refusal(CertsTask, ["../mag1", "--out", out]) =~ ~s("../mag1" is not a robot's name)
    assert refusal(CertsTask, ["--fleet", "/nowhere"]) =~ "cannot be read: no such file"
    assert refusal(CertsTask, ["--fleet", tmp]) =~ "is not a file of names"
    refute File.exists?(out)
    File.mkdir_p!(out)
    File.write!(Path.join(out, "ca.pem"), "")
    assert refusal(CertsTask, ["mag1", "--out", out]) =~ "has a ca.pem, but not its key"
  end
end
