defmodule Mesh.TaskCase do
  @moduledoc """
  Mix tasks that talk to the test instead of a terminal.
  """
  use ExUnit.CaseTemplate

  using do
    quote do
      import Mesh.TaskCase
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

  @doc "The one line with which a task refuses these words; it ends with status 1."
  def refused(task, words) do
    assert catch_exit(task.run(words)) == {:shutdown, 1}
    assert_received {:mix_shell, :error, [line]}
    line
  end
end
