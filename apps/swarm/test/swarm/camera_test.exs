defmodule Swarm.CameraTest do
  use Swarm.Case, async: false
  alias Swarm.{Camera, Cluster}
  alias Vision.View.Picture
  @moduletag :realtime

  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  @camera {Hal.Camera.FFmpeg, source: "lavfi:testsrc=size=64x48:rate=50"}

  defp colours do
    {:ok, colours} =
      Vision.Colours.new([%{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}])

    colours
  end

  test "pictures from the camera of a robot of this node, once and as a stream" do
    id = robot(:seeing1, camera: @camera, colours: colours())
    assert {:ok, <<0xFF, 0xD8, _::binary>>} = Camera.snapshot(id)
    assert {:ok, <<0xFF, 0xD8, _::binary>>} = Camera.snapshot("seeing1")

    assert {:ok, ref} = Camera.subscribe(id, rate: 20)

    for _ <- 1..3 do
      assert_receive {:picture, ^ref, %Picture{width: 64, jpeg: <<0xFF, 0xD8, _::binary>>}}, 5_000
      assert Camera.next(id, ref) == :ok
    end

    assert %{viewers: 1, failed: 0} = Camera.status(id)

    # An unknown subscription returns an error.
    unknown = make_ref()
    assert {:error, "this process has no subscription #Ref" <> _} = Camera.next(id, unknown)
    assert {:error, "this process has no subscription" <> _} = Camera.unsubscribe(id, unknown)
    theirs = Task.await(Task.async(fn -> Camera.next(id, ref) end))
    assert {:error, "this process has no subscription" <> _} = theirs

    # Only the view crashes, and the viewer is notified.
    kill(id, :view)
    assert_receive {:DOWN, ^ref, :process, _, :killed}
    eventually(fn -> match?({:ok, _}, Camera.snapshot(id)) end)
    assert %{viewers: 0} = Camera.status(id)
  end

  @tag :tmp_dir
  test "a robot with the option saves pictures", %{tmp_dir: folder} do
    keep = [folder: folder, rate: 20, files: 3]
    id = robot(:seeing5, camera: @camera, colours: colours(), save_pictures: keep)
    eventually(fn -> match?(%{saver: %{saved: n, files: 3}} when n > 3, Camera.status(id)) end)
    assert Enum.any?(File.ls!(folder), &(&1 =~ ~r/^seeing5-\d{8}T\d{6}\.\d{3}Z\.jpg$/))
    kill(id, :saver)
    eventually(fn -> match?(%{saver: %{saved: n, files: 3}} when n > 0, Camera.status(id)) end)
  end

  test "a missing camera is an error of one line" do
    id = robot(:seeing2)
    assert Camera.snapshot(id) == {:error, "seeing2 has no camera"}

    for bad <- [:nobody, "nobody", :all, [], [id], 7, nil, {id}] do
      assert {:error, line} = Camera.snapshot(bad)
      assert {:error, ^line} = Camera.subscribe(bad)
      assert {:error, ^line} = Camera.next(bad, make_ref())
      refute line =~ "\n"
    end

    assert {:error, ":x is not a reference from subscribe"} = Camera.next(id, :x)
    robot(:seeing3, camera: {Hal.Camera.FFmpeg, source: "/dev/video77"}, colours: colours())
    assert {:error, "rate: expected " <> _} = Camera.subscribe(:seeing3, rate: 0)
    assert {:error, "the camera is offline (:enoent)"} = Camera.snapshot(:seeing3)
  end

  @tag :cluster
  test "pictures do not leave their node: a viewer on another one is refused, whichever way it asks" do
    [node] = Cluster.start_nodes(1)
    robot_on(node, :seeing4, camera: @camera, colours: colours())
    assert {:ok, <<0xFF, 0xD8, _::binary>>} = :erpc.call(node, Camera, :snapshot, [:seeing4])
    assert {:error, line} = Camera.snapshot(:seeing4)
    assert line == "seeing4 is on #{node}, and pictures do not leave their node: look from there"
    assert Camera.subscribe(:seeing4) == {:error, line}

    # The same for a process that has the view itself.
    view = :erpc.call(node, Names, :whereis, [:seeing4, :view])
    assert {:error, line} = Vision.View.snapshot(view)
    assert line =~ "the camera is on #{node}, the viewer on #{node()}"
    assert {:error, ^line} = Vision.View.subscribe(view)
    assert {:error, ^line} = GenServer.call(view, :snapshot)
    assert {:error, ^line} = GenServer.call(view, {:subscribe, make_ref(), 100})
    refute_receive {:picture, _, _}, 100
  end
end
