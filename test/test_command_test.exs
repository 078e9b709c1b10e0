defmodule System.TestCommandTest do
  @moduledoc "What `bin/test` makes of steps that fail, hang or hold no test; the steps are programs of our own making."
  use ExUnit.Case, async: true
  @moduletag :realtime

  @moduletag :tmp_dir
  @root Path.expand("..", __DIR__)
  # What its children inherit, whatever runs this test.
  @own [{"CONVOY_RUN", nil}, {"CONVOY_SKIPPED", nil}, {"JOBS", "2"}]

  # A project of two apps, in which `mix` is this script.
  setup %{tmp_dir: folder} do
    script(folder, "bin/setup", "exit 0")
    script(folder, "bin/test-c", "echo all well")
    script(folder, "bin/opencv-data", "exit 0")
    script(folder, "bin/mcap-python", "exit 0")

    for name <- ~w(bin/test bin/build),
        do: File.cp!(Path.join(@root, name), Path.join(folder, name))

    for {app, calls} <- [upper: "[{:lower, in_umbrella: true}]", lower: "[]"] do
      path = Path.join(folder, "apps/#{app}/mix.exs")
      File.mkdir_p!(Path.dirname(path))
      File.write!(path, calls)
    end

    :ok
  end

  defp script(folder, name, text) do
    path = Path.join(folder, name)
    File.mkdir_p!(Path.dirname(path))
    File.write!(path, "#!/bin/sh\n" <> text <> "\n")
    File.chmod!(path, 0o755)
  end

  defp bin_test(folder, arguments, mix) do
    script(folder, "path/mix", mix)

    System.cmd(Path.join(folder, "bin/test"), arguments,
      env: environment(folder),
      stderr_to_stdout: true
    )
  end

  defp environment(folder),
    do: [{"PATH", Path.join(folder, "path") <> ":" <> System.get_env("PATH")} | @own]

  test "each step's output is whole, and in an order: apps behind those that they call", %{
    tmp_dir: folder
  } do
    assert {said, 0} = bin_test(folder, [], ~s(echo "mix $*"; echo "5 tests, 0 failures"))
    assert said =~ ~r/== lower: tests\nmix test.*\n5 tests.*\n\n== upper: tests\nmix test/
    assert said =~ ~r/== how long each step took.*\d s  lower: tests\n.*\d s +in all\n$/s
    assert said =~ "mix run --no-start test/run.exs --exclude realtime"
    # In real time one at a time, after the rest.
    assert said =~ ~r/test\/run.exs --exclude realtime.*test\/run.exs --only realtime:true/s
  end

  test "a failure ends nothing: all are told at the end, with all that they said", %{
    tmp_dir: folder
  } do
    mix = """
    case "$PWD $*" in
      */lower\\ test*) echo "not so"; exit 3 ;;
      *--only*realtime*) echo "nor that"; exit 4 ;;
    esac
    echo "1 test, 0 failures"
    """

    assert {said, 1} = bin_test(folder, [], mix)

    assert said =~ ~r/ s  lower: tests: FAILED with status 3\n/
    assert said =~ ~r/ s  upper: tests: done\n/

    assert said =~
             ~r/== lower: tests: FAILED after \d+ s with status 3. All that it said:\nnot so\n/

    assert said =~ "nor that\n"

    assert said =~
             "bin/test: FAILED: lower: tests; the whole system: releases; the whole system: in real time\n"
  end

  test "what does not compile ends the run; bad format does not, and is told at the end", %{
    tmp_dir: folder
  } do
    failing = &~s|case "$*" in #{&1}*) echo "bad $1"; exit 1 ;; esac; echo "1 test, 0 failures"|
    assert {said, 1} = bin_test(folder, [], failing.("compile"))
    assert said =~ "bin/test: FAILED: compile without warnings\n"
    refute said =~ "lower: tests"
    assert {said, 1} = bin_test(folder, [], failing.("format"))
    assert said =~ "lower: tests: done"
    assert said =~ "bad format\n\nbin/test: FAILED: format\n"
  end

  describe "a test that fails" do
    # A suite of the app `lower` whose steps fail so; run again, the test ends with that status.
    defp failing(folder, kind, again) do
      File.mkdir_p!(Path.join(folder, "apps/lower/test"))
      File.write!(Path.join(folder, "apps/lower/test/a_test.exs"), "@moduletag :realtime")
      File.mkdir_p!(Path.join(folder, "docs"))
      File.write!(Path.join(folder, "docs/unstable.md"), "")

      bin_test(folder, [], """
      case "$PWD $*" in
        */lower*--only*realtime*)
          printf '#{kind}\\tapps/lower/test/a_test.exs:7\\ttest it (A)\\ttoo late\\n' >>"$CONVOY_FAILED"
          echo "it was late"; exit 2 ;;
        */lower*test/a_test.exs:7) echo "1 test, some"; exit #{again} ;;
      esac
      echo "1 test, 0 failures"
      """)
    end

    test "in real time, and passes alone, is unstable; the second time docs/unstable.md has it",
         %{
           tmp_dir: folder
         } do
      line = "unstable: test it (A) (apps/lower/test/a_test.exs:7), too late\n"
      assert {said, 0} = failing(folder, "realtime", 0)
      assert said =~ "it was late\n"
      assert String.ends_with?(said, line)
      assert File.read!(Path.join(folder, "docs/unstable.md")) == ""
      assert {_said, 0} = failing(folder, "realtime", 0)

      assert File.read!(Path.join(folder, "docs/unstable.md")) =~
               ~r/^\| `apps\/lower\/test\/a_test.exs:7` \| test it \(A\) \| \d{4}-\d\d-\d\d \| too late \|\n$/
    end

    test "in real time and again alone fails the run", %{tmp_dir: folder} do
      assert {said, 1} = failing(folder, "realtime", 2)
      assert said =~ "bin/test: FAILED: lower: in real time\n"
      refute said =~ "unstable:"
    end

    test "without a clock is not repeated", %{tmp_dir: folder} do
      assert {said, 1} = failing(folder, "reckoned", 0)
      refute said =~ "once more"
      assert said =~ "bin/test: FAILED: lower: in real time\n"
    end
  end

  test "a suite without a test fails", %{tmp_dir: folder} do
    assert {said, 1} = bin_test(folder, ["quick"], ~s(echo "0 tests, 0 failures"))

    assert said =~
             "bin/test: this suite ran no test: mix test --warnings-as-errors --exclude slow"
  end

  test "what is not known is told in a line, with what may be meant", %{tmp_dir: folder} do
    for {words, line} <- [
          {["qick"], "qick is not known; did you mean quick?"},
          {["--long"], "--long is not known; did you mean long?"},
          {["all"], "all is not known; quick and long are"},
          {["quick", "long"], "one of quick and long at a time"}
        ] do
      assert {said, 2} = bin_test(folder, words, "exit 1")
      assert [one] = String.split(said, "\n", trim: true)
      assert one =~ line
    end

    assert {help, 0} = bin_test(folder, ["--help"], "exit 1")
    assert help =~ "bin/test quick leaves out"
  end

  # By the mark in their environment, also where they have left their parent.
  if File.dir?("/proc/self") do
    for signal <- ~w(TERM KILL) do
      test "nothing is left of it after a kill -#{signal}", %{tmp_dir: folder} do
        child = Path.join(folder, "child")
        mkfifo = Path.join(folder, "started")
        {_, 0} = System.cmd("mkfifo", [mkfifo])

        script(
          folder,
          "path/mix",
          ~s(echo "$TMPDIR" >"#{child}"; setsid sleep 60 & echo up >"#{mkfifo}"; wait)
        )

        program = Path.join(folder, "bin/test")

        env =
          for {name, value} <- environment(folder),
              do: {to_charlist(name), (value && to_charlist(value)) || false}

        port =
          Port.open({:spawn_executable, program}, [
            :binary,
            :exit_status,
            args: ["quick"],
            env: env
          ])

        {:os_pid, pid} = Port.info(port, :os_pid)
        {"up" <> _, 0} = System.cmd("head", ["-n", "1", mkfifo])
        {_, 0} = System.cmd("kill", ["-#{unquote(signal)}", "#{pid}"])
        assert_receive {^port, {:exit_status, _status}}, 30_000
        work = child |> File.read!() |> String.trim() |> Path.dirname()
        gone(work, System.monotonic_time(:millisecond) + 15_000)

        assert {"", _none} =
                 System.cmd("sh", ["-c", "grep -lzsx 'CONVOY_RUN=#{work}' /proc/[0-9]*/environ"])
      end
    end

    defp gone(work, deadline) do
      if File.exists?(work) do
        assert System.monotonic_time(:millisecond) < deadline, "#{work} is still there"
        receive(do: (:never -> :ok), after: (20 -> gone(work, deadline)))
      end
    end
  end
end
