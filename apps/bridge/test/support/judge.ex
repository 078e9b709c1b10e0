defmodule Bridge.Judge do
  @moduledoc """
  Clients of others: Foxglove's own, npm's `@foxglove/ws-protocol` with `ws`, where `CONVOY_NODE_MODULES` is a folder that has
  both (`npm install @foxglove/ws-protocol ws`); and roslibpy, where `CONVOY_PYTHON`, or `python3`, has it.
  """
  import ExUnit.Assertions
  @script Path.expand("judge.js", __DIR__)

  @doc "Why it cannot judge here, or `false`."
  @spec why_not() :: String.t() | false
  def why_not do
    cond do
      System.find_executable("node") == nil ->
        "node is not installed"

      not File.dir?(modules() <> "/@foxglove/ws-protocol") ->
        "npm's @foxglove/ws-protocol is not installed"

      true ->
        false
    end
  end

  defp modules, do: System.get_env("CONVOY_NODE_MODULES", "/nowhere")

  @doc "What it heard and was answered, a line each."
  def run(url) do
    {said, status} =
      System.cmd("node", [@script, url], env: [{"NODE_PATH", modules()}], stderr_to_stdout: true)

    assert {status, said} == {0, said}
    String.split(said, "\n", trim: true)
  end

  @doc "Why a package of Python cannot judge here, or `false`."
  @spec python_why_not(String.t()) :: String.t() | false
  def python_why_not(package) do
    found = System.find_executable(interpreter())

    if found &&
         match?(
           {_said, 0},
           System.cmd(found, ["-c", "import #{package}"], stderr_to_stdout: true)
         ),
       do: false,
       else: "Python's package #{package} is not installed"
  end

  defp interpreter, do: System.get_env("CONVOY_PYTHON", "python3")

  @doc "What a program in Python prints, a line each; of this folder if its name has none."
  def python(program, arguments, env \\ []) do
    program = if program == "-c", do: program, else: Path.expand(program, __DIR__)

    {said, status} =
      System.cmd(interpreter(), [program | arguments], env: env, stderr_to_stdout: true)

    assert {status, said} == {0, said}
    String.split(said, "\n", trim: true)
  end
end
