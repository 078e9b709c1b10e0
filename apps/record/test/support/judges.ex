defmodule Mcap.Judges do
  @moduledoc """
  The official programs that judge our files, where they are installed: Python's package `mcap`
  (`CONVOY_PYTHON`, what `bin/mcap-python` has made, or `python3`), and `doctor` of MCAP's command line
  (`CONVOY_MCAP`, or `mcap`).
  """
  import ExUnit.Assertions

  @script Path.expand("judge.py", __DIR__)
  @made Path.expand("../../../../_build/mcap-python/bin/python", __DIR__)

  @doc "A Python that has the package, or `nil`."
  @spec python() :: Path.t() | nil
  def python do
    [System.get_env("CONVOY_PYTHON"), @made, "python3"]
    |> Enum.filter(&is_binary/1)
    |> Enum.find_value(fn name ->
      found = System.find_executable(name)
      if found && works?(found, ["-c", "import mcap.reader"]), do: found
    end)
  end

  @doc "MCAP's command line, or `nil`."
  @spec mcap() :: Path.t() | nil
  def mcap do
    found = System.find_executable(System.get_env("CONVOY_MCAP") || "mcap")
    if found && works?(found, ["doctor", "--help"]), do: found
  end

  defp works?(program, arguments),
    do: match?({_said, 0}, System.cmd(program, arguments, stderr_to_stdout: true))

  @doc "The tag of a test that needs them: it is skipped, with the reason, where one is missing."
  @spec tag(:python | :mcap) :: keyword()
  def tag(:python) do
    if python(), do: [], else: [skip: "Python's package mcap is not installed (bin/mcap-python)"]
  end

  def tag(:mcap) do
    if mcap(), do: [], else: [skip: "MCAP's command line (mcap doctor) is not installed"]
  end

  @doc """
  What Python's reader reads of a file, all checksums checked and all JSON parsed, a line each; and
  the messages between two times as `window`.
  """
  @spec read!(Path.t(), integer(), integer()) :: [String.t()]
  def read!(path, from_ns \\ 0, to_ns \\ 1) do
    {said, status} =
      System.cmd(python(), ["-W", "ignore", @script, path, "#{from_ns}", "#{to_ns}"],
        stderr_to_stdout: true
      )

    assert {status, said} == {0, said}
    String.split(said, "\n", trim: true)
  end

  @doc """
  Fails if `doctor` finds an error, or warns of something else than that each chunk has its own
  schemas and channels, which makes it readable alone. With `late: true` messages may also come after
  later ones, which MCAP allows: what a busy process hands over late is written late.
  """
  @spec doctor!(Path.t(), late: boolean()) :: :ok
  def doctor!(path, options \\ []) do
    late? = Keyword.get(options, :late, false)
    {said, status} = System.cmd(mcap(), ["doctor", path], stderr_to_stdout: true)
    assert {status, said} == {0, said}

    odd =
      for line <- String.split(said, "\n", trim: true),
          not (line =~ ~r/Duplicate (channel|schema) records in data section/),
          not (late? and line =~ ~r/^Warning: Message.log_time .* is less than the latest/),
          do: line

    assert odd == []
    :ok
  end
end
