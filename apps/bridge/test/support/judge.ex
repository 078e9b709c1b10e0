defmodule Bridge.Judge do
  @moduledoc """
  Foxglove's own client of its protocol, npm's `@foxglove/ws-protocol` with `ws`, where `CONVOY_NODE_MODULES` is a folder that has
  both (`npm install @foxglove/ws-protocol ws`).
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
end
