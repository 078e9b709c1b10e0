defmodule Mcap.EndlessRecorder do
  @moduledoc """
  A program that records until it is killed, and prints after each flush how many messages it has flushed.
  Started as `erl … -extra PATH`.
  """
  alias Mcap.FileWriter

  @doc "Never returns."
  @spec main() :: no_return()
  def main do
    [path] = :init.get_plain_arguments()
    {:ok, recorder} = FileWriter.start_link(path: "#{path}", chunk_bytes: 20_000)
    {:ok, id} = FileWriter.channel(recorder, "/n", "text", nil)
    record(recorder, id, 1)
  end

  defp record(recorder, id, n) do
    last = n + 199
    for n <- n..last, do: FileWriter.message(recorder, id, n * 1_000_000, payload(n))
    :ok = FileWriter.flush(recorder)
    :io.put_chars("flushed #{last}\n")
    record(recorder, id, last + 1)
  end

  @doc "What the message of this number says."
  @spec payload(pos_integer()) :: binary()
  def payload(n), do: String.duplicate("#{n} ", 40)
end
