defmodule Mix.Tasks.Fleet.SecretTest do
  use Hal.TaskCase, async: false
  alias Mix.Tasks.Fleet.Secret, as: SecretTask

  test "makes one, says its fingerprint, and keeps what is there", %{tmp_dir: folder} do
    path = Path.join(folder, "secret")
    SecretTask.run([path])
    assert_received {:mix_shell, :info, [line]}
    {:ok, secret} = Mesh.Secret.load(path)
    assert line == "#{path} made, fingerprint #{secret.fingerprint}; copy it to every robot"

    assert refusal(SecretTask, [path]) =~ "exists already; --force overwrites it"
    SecretTask.run([path, "--force"])
    assert {:ok, other} = Mesh.Secret.load(path)
    assert other.fingerprint != secret.fingerprint
  end

  test "wrong words are one line" do
    assert refusal(SecretTask, ["--colour"]) ==
             "fleet.secret: unknown option --colour; known are --force, --help"

    assert refusal(SecretTask, ["one", "two"]) == "one file, not 2: one two"
    help = ExUnit.CaptureIO.capture_io(fn -> SecretTask.run(["--help"]) end)
    assert help =~ "Creates the secret of a fleet"
  end
end
