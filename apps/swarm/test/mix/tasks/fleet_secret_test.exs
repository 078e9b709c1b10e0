defmodule Mix.Tasks.Fleet.SecretTest do
  use ExUnit.Case, async: false
  alias Mix.Tasks.Fleet.Secret, as: Task

  @moduletag :tmp_dir

  setup do
    Mix.shell(Mix.Shell.Process)
    on_exit(fn -> Mix.shell(Mix.Shell.IO) end)
  end

  test "makes one, says its fingerprint, and keeps what is there", %{tmp_dir: folder} do
    path = Path.join(folder, "secret")
    Task.run([path])
    assert_received {:mix_shell, :info, [line]}
    {:ok, secret} = Swarm.Mesh.Secret.load(path)
    assert line == "#{path} made, fingerprint #{secret.fingerprint}; copy it to every robot"

    assert refused([path]) =~ "is there already; --force writes over it"
    Task.run([path, "--force"])
    assert {:ok, other} = Swarm.Mesh.Secret.load(path)
    assert other.fingerprint != secret.fingerprint
  end

  test "wrong words are one line" do
    assert refused(["--colour"]) == "--colour is no option; --help lists them"
    assert refused(["one", "two"]) == "one file, not 2: one two"
    Task.run(["--help"])
    assert_received {:mix_shell, :info, ["Makes the one secret" <> _rest]}
  end

  defp refused(words) do
    assert catch_exit(Task.run(words)) == {:shutdown, 1}
    assert_received {:mix_shell, :error, [line]}
    line
  end
end
