defmodule Convoy.Failed do
  @moduledoc """
  Appends each test that failed to the file `CONVOY_FAILED`, for `bin/test`, which runs those that live in real time
  once more: whether it has the tag `:realtime`, `FILE:LINE` from this tree, its name and module, and why, with tabs between them.
  """
  use GenServer

  @root Path.expand("..", __DIR__)

  @impl GenServer
  def init(_options), do: {:ok, System.get_env("CONVOY_FAILED")}

  @impl GenServer
  def handle_cast({:test_finished, %ExUnit.Test{state: {:failed, failures}} = test}, file)
      when file != nil,
      do: append(test, reason(failures), file)

  # Nothing of it has run: what its module sets up has failed.
  def handle_cast({:test_finished, %ExUnit.Test{state: {:invalid, module}} = test}, file)
      when file != nil do
    reason = with %{state: {:failed, failures}} <- module, do: reason(failures)
    append(test, reason, file)
  end

  def handle_cast(_event, file), do: {:noreply, file}

  defp append(%{tags: tags, name: name, module: module}, reason, file) do
    kind = if tags[:realtime], do: "realtime", else: "reckoned"
    place = "#{Path.relative_to(tags.file, @root)}:#{tags.line}"
    fields = [kind, place, "#{name} (#{inspect(module)})", reason]
    File.write!(file, [Enum.map_join(fields, "\t", &line/1), "\n"], [:append])
    {:noreply, file}
  end

  defp reason([{kind, reason, stack} | _more]),
    do: kind |> Exception.format_banner(reason, stack) |> String.slice(0, 300)

  defp line(text), do: text |> String.split() |> Enum.join(" ")
end
