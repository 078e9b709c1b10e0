defmodule Vision.SaverTest do
  use ExUnit.Case, async: true
  @moduletag :realtime
  doctest Vision.Saver.Options
  doctest Vision.Saver.Retention
  alias Vision.{Saver, View}
  alias Vision.Saver.Retention

  @moduletag :tmp_dir
  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])

  # Whether this user may make a small disk.
  @mounts (
            folder = Path.join(System.tmp_dir!(), "saver-#{System.unique_integer([:positive])}")
            File.mkdir_p!(folder)
            words = ["-t", "tmpfs", "none", folder]

            mounts =
              System.find_executable("mount") != nil and
                match?({_, 0}, System.cmd("mount", words, stderr_to_stdout: true))

            if mounts, do: System.cmd("umount", [folder])
            File.rmdir(folder)
            mounts
          )

  defp view do
    demand = View.demand()
    view = start_supervised!({View, demand: demand})

    start_supervised!(
      {Hal.Device,
       kind: :camera,
       driver: {Hal.Camera.FFmpeg, source: "lavfi:testsrc2=size=320x240:rate=50"},
       sinks: [{View, :frame, [view, demand]}]}
    )

    view
  end

  defp saver(folder, options \\ []) do
    for event <- [:failed, :healed] do
      handler = {__MODULE__, event, folder}

      :ok =
        Hal.Event.attach(handler, [:vision, :saver, event], &__MODULE__.tell/4, {folder, self()})

      on_exit(fn -> Hal.Event.detach(handler) end)
    end

    options = [folder: folder, prefix: "mag1", rate: 30] ++ options
    start_supervised!({Saver, Keyword.put_new_lazy(options, :view, &view/0)})
  end

  @doc false
  def tell([_, _, event], _measured, %{folder: folder} = about, {folder, test}),
    do: send(test, {event, about})

  def tell(_event, _measured, _another, _config), do: :ok

  defp eventually(saver, done?, left_ms \\ 20_000) do
    status = Saver.status(saver)

    cond do
      done?.(status) ->
        status

      left_ms <= 0 ->
        flunk("waited in vain: #{inspect(status)}")

      true ->
        receive do
          :never -> :ok
        after
          20 -> eventually(saver, done?, left_ms - 20)
        end
    end
  end

  test "the newest pictures are kept, whole, and their names sort by time", %{tmp_dir: folder} do
    # Others' files, one of a picture that is not this robot's, and half a picture of a power cut.
    kept = ["mag1-notes.txt", "mag1-holiday.jpg", "mag10-20200101T000000.000Z.jpg"]
    old = ["mag1-20200101T000000.000Z.jpg", "mag1-20200101T000001.000Z.jpg"]
    half = "mag1-20200101T000002.000Z.jpg.part"
    for name <- [half | kept ++ old], do: File.write!(Path.join(folder, name), "x")

    saver = saver(folder, files: 5)
    assert %{files: files, why: nil} = eventually(saver, &(&1.saved >= 8))
    assert files == 5

    # Between two pictures: one that is ended while it writes leaves half of one, as a power cut does.
    :ok = :sys.suspend(saver)
    stop_supervised!(Saver)

    names = Enum.sort(File.ls!(folder))
    assert kept -- names == []
    pictures = names -- kept
    assert length(pictures) == 5 and Enum.all?(pictures, &(Retention.time_ms("mag1", &1) != nil))
    refute Enum.any?(old, &(&1 in pictures))

    # They are pictures, all different.
    times = Enum.map(pictures, &Retention.time_ms("mag1", &1))
    assert times == Enum.sort(times) and times == Enum.uniq(times)

    for name <- pictures do
      words = [
        "-v",
        "error",
        "-i",
        Path.join(folder, name) | ~w(-f rawvideo -pix_fmt gray pipe:1)
      ]

      {gray, 0} = System.cmd("ffmpeg", words)
      assert byte_size(gray) == 320 * 240
    end
  end

  test "at most so many megabytes", %{tmp_dir: folder} do
    # Pictures of this camera are some 20 kB, so that these two must go for them, and then theirs.
    for n <- 0..1,
        do:
          File.write!(
            Path.join(folder, "mag1-2020010#{n + 1}T000000.000Z.jpg"),
            :binary.copy("x", 450_000)
          )

    saver = saver(folder, megabytes: 1)
    eventually(saver, &(&1.saved >= 12))
    assert %{bytes: bytes} = Saver.status(saver)
    :ok = :sys.suspend(saver)
    stop_supervised!(Saver)
    sizes = for name <- File.ls!(folder), do: File.stat!(Path.join(folder, name)).size
    assert Enum.sum(sizes) <= 1_000_000 and bytes <= 1_000_000
    refute "mag1-20200101T000000.000Z.jpg" in File.ls!(folder)
  end

  test "a folder that is not there is told, not made; when it is there, saving begins", %{
    tmp_dir: folder
  } do
    folder = Path.join(folder, "disk")
    saver = saver(folder)
    assert_receive {:failed, %{reason: :enoent, line: line}}, 5_000
    assert line == "no pictures are saved in #{folder}: no such file or directory"
    assert %{saved: 0, why: ^line} = Saver.status(saver)
    refute File.exists?(folder)
    File.mkdir!(folder)
    assert_receive {:healed, _}, 10_000
    assert %{why: nil} = eventually(saver, &(&1.saved > 0))

    # Gone while it saves, and back.
    File.rename!(folder, folder <> "-away")
    assert_receive {:failed, %{reason: :enoent}}, 5_000
    File.rename!(folder <> "-away", folder)
    assert_receive {:healed, _}, 10_000
  end

  @tag if(@mounts, do: [], else: [skip: "only root makes a small disk"])
  test "a full disk is told once, leaves no half pictures, and heals when there is room", %{
    tmp_dir: folder
  } do
    {_, 0} = System.cmd("mount", ~w(-t tmpfs -o size=400k none) ++ [folder])
    on_exit(fn -> System.cmd("umount", ["-l", folder]) end)
    ballast = Path.join(folder, "ballast")
    File.write!(ballast, :binary.copy("x", 300_000))
    saver = saver(folder)
    assert_receive {:failed, %{reason: :enospc, line: line}}, 10_000
    assert line == "no pictures are saved in #{folder}: no space left on device"
    assert %{saved: saved, why: ^line} = Saver.status(saver)
    assert saved in 1..8
    assert File.ls!(folder) |> Enum.filter(&String.ends_with?(&1, ".part")) == []
    # A smaller picture might still fit, and the next one be told anew: nothing fits now.
    {:error, :enospc} = File.write(Path.join(folder, "rest"), :binary.copy("x", 400_000))
    %{saved: saved} = eventually(saver, &(&1.why == line))
    flush()
    # Tried in vain meanwhile, and told once.
    refute_receive {:failed, _}, 1_500
    File.rm!(ballast)
    assert_receive {:healed, _}, 10_000
    assert %{why: nil} = eventually(saver, &(&1.saved > saved))
    stop_supervised!(Saver)
  end

  defp flush do
    receive do
      {told, _about} when told in [:failed, :healed] -> flush()
    after
      0 -> :ok
    end
  end

  test "a view that falls is looked through again", %{tmp_dir: folder} do
    name = :"saver_view_#{System.unique_integer([:positive])}"
    demand = View.demand()
    start_supervised!({View, demand: demand, name: name})

    start_supervised!(
      {Hal.Device,
       kind: :camera,
       driver: {Hal.Camera.FFmpeg, source: "testsrc"},
       sinks: [{View, :frame, [name, demand]}]}
    )

    saver = saver(folder, view: name)
    %{saved: saved} = eventually(saver, &(&1.saved > 0))
    Process.exit(Process.whereis(name), :kill)
    eventually(saver, &(&1.saved > saved + 2))
  end

  test "a clock that is set back does not bring the names out of order" do
    {retention, names} =
      Enum.reduce(
        [5_000, 4_000, 4_000, 9_000, 0],
        {Retention.new("mag1", 10, 100, []), []},
        fn now, {retention, names} ->
          name = Retention.name(retention, now)
          {Retention.put(retention, name, 1), names ++ [name]}
        end
      )

    assert names == Enum.sort(names) and names == Enum.uniq(names)
    assert Retention.size(retention) == {5, 5}
    # And a new start goes on behind what is there.
    again = Retention.new("mag1", 10, 100, Enum.shuffle(for name <- names, do: {name, 1}))
    assert Retention.name(again, 0) > List.last(names)
  end

  test "whatever is saved, the limits hold, and only the oldest go" do
    for _ <- 1..50 do
      files = :rand.uniform(10)

      Enum.reduce(1..60, {Retention.new("mag1", files, 1_000, []), []}, fn now,
                                                                           {retention, there} ->
        size = :rand.uniform(500)
        {:ok, gone, retention} = Retention.room(retention, size)
        assert gone == Enum.take(there, length(gone))
        name = Retention.name(retention, now)
        retention = Retention.put(retention, name, size)
        there = Enum.drop(there, length(gone)) ++ [name]
        assert {count, bytes} = Retention.size(retention)
        assert count == length(there) and count <= files and bytes <= 1_000
        {retention, there}
      end)
    end
  end

  test "wrong options are named" do
    for {bad, name} <- [
          {[rate: 0], "rate"},
          {[rate: 1.0e300], "rate"},
          {[files: 1.5], "files"},
          {[megabytes: 0], "megabytes"},
          {[folder: 7], "folder"},
          {[folder: "/tmp", colour: 1], "colour is not known"},
          {:all, ":all"}
        ] do
      assert {:error, line} = Saver.options(bad)
      assert line =~ name
      refute line =~ "\n"
    end
  end
end
