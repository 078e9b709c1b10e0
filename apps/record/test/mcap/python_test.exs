defmodule Mcap.PythonTest do
  @moduledoc """
  Python's `mcap`, the official reader, reads what we write, where it is installed (`Mcap.Judges`).
  """
  use ExUnit.Case, async: true
  alias Mcap.{Foxglove, Judges, Payloads, Samples, Writer}

  @moduletag :tmp_dir
  @moduletag :slow
  @moduletag Mcap.Judges.tag(:python)

  defp hex(data), do: Base.encode16(data, case: :lower)

  test "messages, times, counts, notes and checksums", %{tmp_dir: dir} do
    {messages, _state} = Samples.messages(500, :rand.seed_s(:exsss, 4))
    path = Path.join(dir, "run.mcap")

    for offsets? <- [true, false] do
      {file, _pieces} = Samples.file(messages, each: 30, summary_offsets: offsets?)
      File.write!(path, file)
      {{_, from, _}, {_, last, _}} = {hd(messages), List.last(messages)}
      middle = div(from + last, 2)
      said = Judges.read!(path, middle, last)

      assert "count 500 chunks 17 from #{from} to #{last}" in said
      assert ~s(note made by {"a": "1", "b": "2"}) in said
      assert "records Footer" in said
      inside = Enum.count(messages, fn {_topic, ns, _data} -> ns >= middle and ns < last end)
      assert "window #{inside}" in said

      {expected, _counts} =
        Enum.map_reduce(messages, %{}, fn {topic, ns, data}, counts ->
          n = Map.get(counts, topic, 0)
          {"message #{topic} #{n} #{ns} #{hex(data)}", Map.put(counts, topic, n + 1)}
        end)

      assert for("message" <> _ = line <- said, do: line) == expected

      {:ok, t} = Mcap.Reader.open(path)
      counts = Mcap.Reader.summary(t).counts

      for channel <- Mcap.Reader.summary(t).channels do
        schema = if channel.schema, do: elem(channel.schema, 0), else: "-"
        metadata = ~s({"topic": "#{channel.topic}"})

        assert "channel #{channel.id} #{channel.topic} json #{schema} #{counts[channel.id]} #{metadata}" in said
      end
    end
  end

  test "Foxglove's payloads and schemas are JSON, byte for byte ours", %{tmp_dir: dir} do
    {t, head} = Writer.new()

    {t, expected} =
      1_700_000_000_000_000_000
      |> Payloads.all()
      |> Enum.with_index(1)
      |> Enum.reduce({t, []}, fn {{name, payload}, ns}, {t, expected} ->
        {id, t} = Writer.channel(t, "/#{name}", "json", Foxglove.schema(name), %{})
        {t, []} = Writer.message(t, id, ns, payload)
        {t, [{"/#{name}", ns, hex(IO.iodata_to_binary(payload))} | expected]}
      end)

    path = Path.join(dir, "run.mcap")
    File.write!(path, [head, Writer.finish(t)])
    said = for "message " <> rest <- Judges.read!(path), do: String.split(rest, " ")

    assert for([topic, _n, ns, data] <- said, do: {topic, String.to_integer(ns), data}) ==
             Enum.reverse(expected)
  end

  test "a folder's files", %{tmp_dir: dir} do
    {:ok, recorder} = Mcap.FileWriter.start_link(path: dir, limit_bytes: 0x40_0000)
    {:ok, id} = Mcap.FileWriter.channel(recorder, "/n", "text", nil)
    for n <- 1..6000, do: Mcap.FileWriter.message(recorder, id, n, String.duplicate("#{n} ", 60))
    assert :ok = Mcap.FileWriter.close(recorder)

    counts =
      for name <- Enum.sort(File.ls!(dir)) do
        ["count " <> count | _] = Judges.read!(Path.join(dir, name))
        count |> Integer.parse() |> elem(0)
      end

    assert length(counts) > 2 and Enum.sum(counts) == 6000
  end
end
