defmodule Mesh.SecretTest do
  use ExUnit.Case, async: true
  alias Mesh.Secret
  doctest Secret

  @moduletag :tmp_dir

  defp file(folder, text, mode \\ 0o600) do
    path = Path.join(folder, "secret")
    File.write!(path, text)
    File.chmod!(path, mode)
    path
  end

  defp random, do: Base.encode64(:crypto.hash(:sha256, "a good one"))

  test "key and cookie come from the file, and neither tells the other", %{tmp_dir: folder} do
    path = file(folder, random() <> "\n")
    assert {:ok, %{key: <<key::binary-size(32)>>, cookie: cookie}} = Secret.load(path)
    assert Atom.to_string(cookie) =~ ~r/\A[a-z2-7]{52}\z/
    refute Base.encode32(key, case: :lower, padding: false) == Atom.to_string(cookie)
    # The derivation is fixed: robots of different releases understand each other.
    bytes = Base.decode64!(random())
    assert key == :crypto.mac(:hmac, :sha256, bytes, "convoy datagrams 1")
    assert {:ok, %{key: ^key}} = path |> file_again(Base.encode16(bytes)) |> Secret.load()
  end

  test "what others may read is refused, and the line says how to close it", %{tmp_dir: folder} do
    for mode <- [0o644, 0o640, 0o604, 0o602, 0o620] do
      path = file(folder, random(), mode)
      assert {:error, line} = Secret.load(path)
      assert line =~ "may be read by others (mode 0#{Integer.to_string(mode, 8)}, must be 0600)"
      assert line =~ "chmod 600 #{quoted(path)}"
    end
  end

  test "what is no secret is refused in one line with the command", %{tmp_dir: folder} do
    assert {:error, line} = Secret.load(folder)
    assert line =~ "#{folder} is not a file; make one: mix fleet.secret #{quoted(folder)} --force"

    for {text, problem} <- [
          {"", "is empty"},
          {" \n", "is empty"},
          {"cookie", "is too short"},
          {"not base64 at all!", "is not base64 or hex text"},
          {<<0, 255, 17>>, "is not base64"},
          {Base.encode64(<<1::256>>), "is weak"},
          {String.duplicate("x", 9_000), "is far too long"}
        ] do
      path = file(folder, text)
      assert {:error, line} = Secret.load(path)
      assert line =~ "the fleet's secret #{path} #{problem}"
      assert String.ends_with?(line, "; make one: mix fleet.secret #{quoted(path)} --force")
      refute line =~ "\n"
    end
  end

  test "names that are no file's, or strange ones, stay one line" do
    for path <- ["a\0b", <<255>>, "two\nlines", "", String.duplicate("x", 5_000)] do
      assert {:error, line} = Secret.load(path)
      refute line =~ "\n"
    end
  end

  test "the environment names the file" do
    assert {:error, line} = Secret.from_env(%{"CONVOY_SECRET_FILE" => "/nowhere/it is"})
    assert line =~ "/nowhere/it is does not exist; make one: mix fleet.secret '/nowhere/it is'"
    assert {:error, line} = Secret.from_env(%{})
    assert line =~ "secret convoy.secret does not exist"
  end

  test "made, it is for its owner alone and is not written over", %{tmp_dir: folder} do
    path = Path.join([folder, "new", "secret"])
    assert {:ok, secret} = Secret.create(path)
    assert {:ok, %File.Stat{mode: 0o100600}} = File.stat(path)
    assert {:error, line} = Secret.create(path)
    assert line =~ "exists already; --force overwrites it"
    assert {:ok, ^secret} = Secret.load(path)
    assert {:ok, other} = Secret.create(path, true)
    assert other.key != secret.key
    assert {:ok, %File.Stat{mode: 0o100600}} = File.stat(path)
    assert File.ls!(Path.dirname(path)) == ["secret"]
    assert {:error, line} = Secret.create("/proc/nowhere/secret")
    assert line =~ "cannot be written"
  end

  test "the command for where no Mix is makes a good one", %{tmp_dir: folder} do
    path = Path.join(folder, "it's here")
    for there? <- [false, true], do: make(Secret.command(path, false, there?), path)
  end

  test "it does not show when inspected, nor in the state of a process", %{tmp_dir: folder} do
    {:ok, secret} = Secret.load(file(folder, random()))
    shown = inspect(%{options: [secret: secret]}, limit: :infinity)
    assert shown =~ secret.fingerprint
    refute shown =~ Atom.to_string(secret.cookie)
    refute shown =~ inspect(secret.key)
  end

  test "a node without a name is told so", %{tmp_dir: folder} do
    {:ok, secret} = Secret.load(file(folder, random()))

    # One of its own: other tests give theirs a name.
    refused = Vm.call(Vm.start_one(), Secret, :apply_cookie, [secret])
    assert {:error, "this node has no name" <> _rest} = refused
  end

  # As a shell takes it for one word.
  defp quoted(path) do
    "mix fleet.secret " <> quoted = Secret.command(path, true, false)
    quoted
  end

  defp make(command, path) do
    {"", 0} = System.cmd("sh", ["-c", command], stderr_to_stdout: true)
    assert {:ok, _secret} = Secret.load(path)
  end

  defp file_again(path, text) do
    File.write!(path, text)
    path
  end
end
