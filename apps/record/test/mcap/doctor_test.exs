defmodule Mcap.DoctorTest do
  @moduledoc "`doctor` of MCAP's command line finds nothing wrong in what we write, where it is installed."
  use ExUnit.Case, async: true
  alias Mcap.{Foxglove, Judges, Payloads, Samples, Writer}

  @moduletag :tmp_dir
  @moduletag :slow
  @moduletag Judges.tag(:mcap)

  test "files of many chunks, with summary offsets or without", %{tmp_dir: dir} do
    {messages, _state} = Samples.messages(500, :rand.seed_s(:exsss, 4))
    path = Path.join(dir, "run.mcap")

    for offsets? <- [true, false] do
      {file, _pieces} = Samples.file(messages, each: 30, summary_offsets: offsets?)
      File.write!(path, file)
      assert Judges.doctor!(path) == :ok
    end
  end

  test "a file of all of Foxglove's payloads, and an empty one", %{tmp_dir: dir} do
    {t, head} = Writer.new()
    path = Path.join(dir, "run.mcap")
    File.write!(path, [head, Writer.finish(t)])
    assert Judges.doctor!(path) == :ok

    t =
      for {{name, payload}, ns} <- Enum.with_index(Payloads.all(1), 1), reduce: t do
        t ->
          {id, t} = Writer.channel(t, "/#{name}", "json", Foxglove.schema(name), %{})
          {t, []} = Writer.message(t, id, ns, payload)
          t
      end

    File.write!(path, [head, Writer.finish(t)])
    assert Judges.doctor!(path) == :ok
  end

  test "what it would find: a damaged chunk", %{tmp_dir: dir} do
    {messages, _state} = Samples.messages(50, :rand.seed_s(:exsss, 5))
    {file, _pieces} = Samples.file(messages)
    path = Path.join(dir, "run.mcap")
    at = div(byte_size(file), 2)
    <<before::binary-size(at), byte, rest::binary>> = file
    File.write!(path, [before, Bitwise.bxor(byte, 0xFF), rest])
    assert_raise ExUnit.AssertionError, fn -> Judges.doctor!(path) end
  end
end
