defmodule Lines do
  @moduledoc """
  Command lines of a shell, done one after the other. Those of `mix` share a VM, which answers for each what it prints
  and its status, as a process of its own would; it takes most of a second of processor time to start. The others are
  given to `sh`.
  """
  @seconds 60

  @typedoc "The words of a Mix task, or a line for `sh`."
  @type line :: [String.t(), ...] | String.t()

  @type answer :: {output :: String.t(), errors :: String.t(), status :: non_neg_integer()}

  @doc """
  The answers to these lines, in their order. `cd:` is the folder, a project of Mix; `env:` the environment.
  `stderr_to_stdout: true` has errors come among the output.
  """
  @spec run([line()], keyword()) :: [answer()]
  def run(lines, options) do
    {one?, options} = Keyword.pop(options, :stderr_to_stdout, false)
    told = Path.join(System.tmp_dir!(), "convoy-lines-#{System.pid()}-#{unique()}")
    File.write!(told, :erlang.term_to_binary({lines, one?}))
    script = Path.expand("lines/answer.exs", __DIR__)
    options = [stderr_to_stdout: true] ++ options

    try do
      seconds = @seconds * length(lines)
      command = ~s(exec timeout #{seconds} mix run --no-start "$@" </dev/null)
      {printed, status} = System.cmd("sh", ["-c", command, "sh", script, told], options)
      status == 0 || raise "#{command}: status #{status}: #{printed}"
      told |> File.read!() |> :erlang.binary_to_term()
    after
      File.rm!(told)
    end
  end

  defp unique, do: System.unique_integer([:positive])
end
