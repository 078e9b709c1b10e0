defmodule Hal.TaskCase do
  @moduledoc """
  Mix tasks that talk to the test instead of a terminal.
  """
  use ExUnit.CaseTemplate

  using do
    quote do
      import Hal.TaskCase
      @moduletag :tmp_dir
    end
  end

  setup do
    Mix.shell(Mix.Shell.Process)
    on_exit(fn -> Mix.shell(Mix.Shell.IO) end)
  end

  @doc "What a task has said to the test so far, line by line."
  def said do
    receive do
      {:mix_shell, :info, [line]} -> [line | said()]
    after
      0 -> []
    end
  end

  @doc "The lines with which a task refuses these words; it ends with status 1."
  def refused(task, words) do
    assert catch_exit(task.run(words)) == {:shutdown, 1}
    errors()
  end

  @doc "The same, where it is one line."
  def refusal(task, words) do
    assert [line] = refused(task, words)
    line
  end

  @doc "The errors that a task has told the test so far, line by line."
  def errors do
    receive do
      {:mix_shell, :error, [line]} -> [line | errors()]
    after
      0 -> []
    end
  end
end
