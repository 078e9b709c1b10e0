defmodule Lab.Recording.JudgedTest do
  @moduledoc """
  A recording of a run in lockstep and one of robots of processes, both with pictures: what they have
  for viewers, and what the official reader and `doctor` say of them, where these are installed.
  """
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1]
  alias Mcap.{Json, Judges}
  alias Mcap.Foxglove.Schemas
  alias Lab.{Fleet, Recorder, Recording, Replay, Trial}
  alias Lab.Recording.Pictures
  doctest Lab.Recording.Pictures
  @moduletag :realtime
  @moduletag :capture_log

  @robots [:mag81, :min81]

  setup_all do
    folder = Path.join(System.tmp_dir!(), "judged-#{System.pid()}")
    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    {run, live} = {Path.join(folder, "run.mcap"), Path.join(folder, "live.mcap")}
    trial = run(run)
    live(live)
    %{run: run, live: live, trial: trial, folder: folder}
  end

  # 3 s, in which the first robot goes blind.
  defp run(path) do
    {:ok, setup} =
      Trial.setup(%{robots: [:mag1, :min1], seed: 5, script: [{2, {:blind, :mag1, 10}}]})

    {:ok, recorder} = Recorder.start_link(path, setup, pictures: true)

    trial =
      Enum.reduce(1..30, Trial.begin(setup, record: true), fn _tick, before ->
        {entries, trial} = before |> Trial.step() |> Trial.take_entries()
        tick = {trial.at_ms, entries}
        :ok = Recorder.tick(recorder, tick, Trial.scene(trial), Pictures.due(before, 2))
        trial
      end)

    :ok = Recorder.close(recorder)
    trial
  end

  defp live(path) do
    {:ok, _apps} = Application.ensure_all_started(:swarm)

    {:ok, recorder} = Record.Recorder.start_link(robots: @robots, file: [path: path], pictures: 5)

    {:ok, fleet} =
      Fleet.start_link(robots: @robots, seed: 1, trace: {Record.Recorder, :trace, []})

    # Until there are pictures of both.
    eventually(fn ->
      Fleet.scene(fleet).at_ms >= 2_000 and
        Enum.all?(@robots, &(Vision.View.status(Robot.Names.via(&1, :view)).made > 2))
    end)

    Fleet.stop(fleet)
    :ok = Record.Recorder.close(recorder)
  end

  defp messages(path, topic) do
    {:ok, reader} = Mcap.Reader.open(path)

    for {_topic, channel, ns, data} <- Mcap.Reader.messages(reader, topics: [topic]) do
      value = Json.decode!(data)
      # Each is what its schema says.
      with {name, "jsonschema", _text} <- channel.schema,
           do: assert(Json.problems(value, Json.decode!(Schemas.text(name))) == [])

      {ns, value}
    end
  end

  defp at({:object, pairs}, key), do: pairs |> List.keyfind(key, 0) |> elem(1)

  defp at_ms(picture), do: at(at(picture, "timestamp"), "nsec") |> div(1_000_000)

  test "pictures of a run are those in which its blobs were found, with their boxes", context do
    {:ok, file} = Recording.File.open(context.run)

    seen =
      for {_at_ms, entries} <- Recording.File.ticks(file),
          {:step, id, {:detections, seen}, _effects} <- entries,
          into: %{},
          do: {{id, rem(seen.at_ms, 1_000), div(seen.at_ms, 1_000)}, seen}

    for {id, count} <- [mag1: 4, min1: 6] do
      pictures = messages(context.run, "/#{id}/camera")
      boxes = messages(context.run, "/#{id}/camera/blobs")
      assert {id, length(pictures), length(boxes)} == {id, count, count}

      for {{ns, picture}, {ns, boxes}} <- Enum.zip(pictures, boxes) do
        assert {at(picture, "format"), at(picture, "frame_id")} == {"jpeg", "#{id}"}
        assert <<0xFF, 0xD8, _::binary>> = Base.decode64!(at(picture, "data"))
        key = {id, at_ms(picture), at(at(picture, "timestamp"), "sec")}
        %{^key => detections} = seen
        assert ns == (detections.at_ms + 100) * 1_000_000
        labels = for text <- at(boxes, "texts"), do: at(text, "text")
        assert labels == Enum.map(detections.blobs, & &1.colour)
      end
    end
  end

  test "the same run gives the same file, and its pictures are no input of a replay", context do
    again = Path.join(context.folder, "again.mcap")
    _trial = run(again)
    assert File.read!(again) == File.read!(context.run)

    {:ok, file} = Recording.File.open(context.run)

    replay =
      Enum.reduce(Recording.File.ticks(file), Replay.new(file.setup), fn tick, replay ->
        assert {replay, []} = Replay.step(replay, tick)
        replay
      end)

    assert Replay.trial(replay).world == context.trial.world
  end

  test "a live robot's topics: pictures, what it knows, what it claims, heard and sent",
       context do
    for id <- @robots do
      assert [_, _ | _] = pictures = messages(context.live, "/#{id}/camera")
      for {_ns, picture} <- pictures, do: assert(at(picture, "format") == "jpeg")
      assert [_ | _] = messages(context.live, "/#{id}/camera/blobs")

      assert [{_ns, scene} | _] = context.live |> messages("/#{id}/scene") |> Enum.reverse()
      names = for entity <- at(scene, "entities"), do: at(entity, "id")
      assert Enum.all?(["doubt" | Enum.map(@robots, &"#{&1}")], &(&1 in names))

      assert [{_ns, claim} | _] = messages(context.live, "/#{id}/mission")
      assert is_binary(at(claim, "phase"))
      assert [{_ns, message} | _] = messages(context.live, "/#{id}/messages")
      assert at(message, "kind") in ~w(round heartbeat place relay)
    end

    {:ok, file} = Record.Recording.File.open(context.live)
    assert {_replay, []} = Record.Replayed.replay(file)
  end

  @tag Judges.tag(:python)
  test "the official reader reads both", context do
    for path <- [context.run, context.live] do
      {:ok, reader} = Mcap.Reader.open(path)
      said = Judges.read!(path)
      count = Mcap.Reader.summary(reader).count
      assert Enum.any?(said, &String.starts_with?(&1, "count #{count} "))
      assert Enum.count(said, &String.starts_with?(&1, "message ")) == count
      assert "records Footer" in said
    end
  end

  @tag Judges.tag(:mcap)
  test "doctor finds nothing wrong in either", context do
    assert Judges.doctor!(context.run) == :ok
    assert Judges.doctor!(context.live, late: true) == :ok
  end
end
