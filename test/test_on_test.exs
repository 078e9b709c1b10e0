defmodule System.TestOnTest do
  @moduledoc """
  What `bin/test-on` refuses, and that it deletes nothing below a mount. Its trials of whole systems are CI's.
  """
  use ExUnit.Case, async: true

  @root Path.expand("..", __DIR__)

  # Whether this machine lets its user mount, in a namespace that ends with the command.
  @mounts (case System.find_executable("unshare") do
             nil ->
               false

             unshare ->
               arguments = ~w(--mount --pid --fork --kill-child -- mount -t tmpfs none /tmp)
               match?({_, 0}, System.cmd(unshare, arguments, stderr_to_stdout: true))
           end)

  defp test_on(arguments, environment \\ []) do
    options = [env: environment, stderr_to_stdout: true]
    System.cmd(Path.join(@root, "bin/test-on"), arguments, options)
  end

  test "the help says what it does, what it needs and how it ends" do
    assert {help, 0} = test_on(["--help"])

    for words <- ["bookworm", "trixie", "It needs root", "CONVOY_ROOTS", "77"],
        do: assert(help =~ words)
  end

  for {arguments, complaint} <- [
        {[], "which Debian? bookworm or trixie"},
        {["trixi"], "did you mean trixie?"},
        {["12"], "did you mean bookworm?"},
        {["../../etc"], "../../etc is not a suite"},
        {["trixie", "bookworm"], "one suite at a time"},
        {["trixie", "--kepe"], "did you mean --keep?"},
        {["trixie", "--mirror"], "--mirror needs a URL"},
        {["trixie", "--mirror", "--keep"], "--mirror --keep is not a URL"}
      ] do
    test "refuses #{inspect(arguments)} in a line" do
      assert {said, 2} = test_on(unquote(arguments))
      assert [line] = String.split(said, "\n", trim: true)
      assert line =~ unquote(complaint)
    end
  end

  test "who is not root is told why that is needed" do
    as =
      if match?({"0\n", 0}, System.cmd("id", ["-u"])),
        do: ~w(setpriv --reuid 65534 --clear-groups),
        else: []

    # By standard input, because others may not be allowed to enter this folder.
    script = ~s(script=$1; shift; exec "$@" sh -s -- trixie <"$script")
    command = ["-c", script, "sh", Path.join(@root, "bin/test-on") | as]
    assert {said, 77} = System.cmd("sh", command, cd: "/", stderr_to_stdout: true)
    assert said =~ "only root may make a system and mount /proc in it"
  end

  describe "as root" do
    @describetag skip: unless(@mounts, do: "this user may not mount here")

    # Outside of the tree, as bin/test-on demands.
    setup do
      folder = Path.join(System.tmp_dir!(), "convoy-roots-#{System.unique_integer([:positive])}")
      on_exit(fn -> File.rm_rf!(folder) end)
      %{folder: folder}
    end

    test "nothing is deleted below which something is mounted", %{folder: folder} do
      # A system that was kept, and somebody who looks into it: a mount that this script has not made.
      for name <- ~w(base trial/dev), do: File.mkdir_p!(Path.join([folder, "trixie", name]))
      dev = Path.join(folder, "trixie/trial/dev")

      script = """
      mount -t tmpfs none "$1"
      echo precious >"$1/file"
      "$2" trixie; echo "status $?"
      cat "$1/file"
      """

      arguments = ["--mount", "sh", "-c", script, "sh", dev, Path.join(@root, "bin/test-on")]
      options = [env: [{"CONVOY_ROOTS", folder}], stderr_to_stdout: true]
      assert {said, 0} = System.cmd("unshare", arguments, options)
      assert said =~ "#{dev} is mounted: nothing in"
      assert said =~ "status 1\nprecious\n"
      assert File.dir?(Path.join(folder, "trixie/base"))
    end

    test "two at a time are refused, and a folder in this tree", %{folder: folder} do
      home = Path.join(folder, "trixie")
      File.mkdir_p!(home)
      lock = Path.join(home, "lock")
      held = [lock, Path.join(@root, "bin/test-on"), "trixie"]
      options = [env: [{"CONVOY_ROOTS", folder}], stderr_to_stdout: true]
      assert {said, 1} = System.cmd("flock", held, options)
      assert said =~ "another bin/test-on trixie is at work in #{home}"

      assert {said, 1} = test_on(["trixie"], [{"CONVOY_ROOTS", Path.join(@root, "_build/roots")}])
      assert said =~ "is in this tree; it must be outside"
      refute File.exists?(Path.join(@root, "_build/roots"))

      assert {said, 1} = test_on(["trixie"], [{"CONVOY_ROOTS", "/tmp/a b"}])
      assert said =~ "letters, digits and . _ / - are allowed"
    end
  end
end
