defmodule Bridge.RmfTest do
  @moduledoc "The fleet manager of Open-RMF's adapter, by Erlang's own HTTP client; the calls are those of the adapter, its traps included."
  use ExUnit.Case, async: false
  alias Console.{FakeLive, Page}
  alias Hal.Pose
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: Console.PageCase.no_server() || false

  @prefix "open-rmf/rmf_demos_fm/"

  setup do
    {:ok, _apps} = Application.ensure_all_started(:inets)

    {:ok, live} =
      FakeLive.start_link(FakeLive.of([{:mag1, {1.0, 2.0}, []}, {:mag2, {3.0, 2.0}, []}]))

    served = [module: FakeLive, live: live, robots: [:mag1, :mag2], service: Bridge.Rmf]
    {:ok, _page, url} = Page.start_link(served)
    %{live: live, url: url}
  end

  defp get(%{url: url}, call), do: ask(:get, {~c"#{url}#{@prefix}#{call}", []})

  defp post(%{url: url}, call, body, headers \\ []) do
    body = if is_binary(body), do: body, else: Hal.Json.encode!(body)
    ask(:post, {~c"#{url}#{@prefix}#{call}", headers, ~c"application/json", body})
  end

  defp ask(method, request) do
    {:ok, {{_http, status, _}, _headers, body}} =
      :httpc.request(method, request, [ssl: []], body_format: :binary)

    case Bridge.Json.decode(body) do
      {:ok, %{} = answer} when status == 200 -> answer
      _line -> {status, String.trim(body)}
    end
  end

  defp navigate(c, id, {x, y, yaw}, robot \\ "mag1") do
    body = %{map_name: "L1", destination: %{x: x, y: y, yaw: yaw}, speed_limit: 0.0}
    post(c, "navigate?robot_name=#{robot}&cmd_id=#{id}", body)
  end

  defp data(c), do: get(c, "status?robot_name=mag1")["data"]

  defp change(live, about),
    do:
      FakeLive.change(live, fn scene ->
        robots =
          for robot <- scene.robots,
              do: if(robot.id == :mag1, do: Map.merge(robot, about), else: robot)

        %{scene | robots: robots}
      end)

  test "says where a robot is, and of one that is not known that it is not", c do
    assert %{"success" => true, "data" => data} = get(c, "status?robot_name=mag1")

    assert %{
             "robot_name" => "mag1",
             "map_name" => "L1",
             "position" => %{"x" => 1.0, "y" => 2.0, "yaw" => 0.5},
             "last_completed_request" => nil,
             "replan" => false
           } = data

    assert %{"success" => false, "data" => none} = get(c, "status?robot_name=mag9")
    assert none == %{}

    assert %{"all_robots" => [_mag1, _mag2], "data" => %{"all_robots" => [_, _]}} =
             get(c, "status/")

    change(c.live, %{pose: nil})

    Swarm.Case.eventually(fn ->
      match?(%{"success" => false}, get(c, "status?robot_name=mag1"))
    end)

    assert %{"all_robots" => [%{"robot_name" => "mag2"}]} = get(c, "status")
  end

  test "a command is one as often as it is asked for, and done when the robot is there", c do
    assert %{"success" => true} = navigate(c, 3, {4.0, -1.0, 1.5})
    assert %{"success" => true} = navigate(c, 3, {4.0, -1.0, 1.5})
    assert FakeLive.told(c.live) == [{:tell, [:mag1], {:goto, 4.0, -1.0, 1.5}}]

    # It has ended elsewhere: the adapter is asked for another way, once.
    change(c.live, %{state: :given_up})
    Swarm.Case.eventually(fn -> data(c)["replan"] end, 5_000)
    assert %{"replan" => false, "last_completed_request" => nil} = data(c)

    assert %{"success" => true} = navigate(c, 4, {4.0, -1.0, 1.5})
    change(c.live, %{state: :done, pose: Pose.new(4.05, -1.0, 1.5)})
    Swarm.Case.eventually(fn -> data(c)["last_completed_request"] == 4 end, 5_000)

    # An adapter that was started again counts from 1.
    assert %{"success" => true} = navigate(c, 1, {0.0, 0.0, 0.0})
    assert data(c)["last_completed_request"] == nil
  end

  test "a stop is done when the robot stands", c do
    # As the adapter says it, with what its library makes of a time-out.
    stop = "stop_robot?robot_name=mag1&running_cmd_id=1&stop_cmd_id=2&5.0"
    assert %{"success" => true} = get(c, stop)
    assert FakeLive.told(c.live) == [{:tell, [:mag1], :stop}]
    assert data(c)["last_completed_request"] == nil
    Swarm.Case.eventually(fn -> data(c)["last_completed_request"] == 2 end, 5_000)
  end

  test "one that still rolls does not stand, though it is seen at the same place twice" do
    alias Bridge.Rmf.Command
    command = Command.given(%Command{id: 2, goal: :stop}, 2, 0)
    robot = %{pose: Pose.new(1, 2), state: :idle, speed: 0.2}
    assert Command.seen(command, robot, robot, 2_000).completed == nil
    assert Command.seen(command, %{robot | speed: nil}, robot, 2_000).completed == nil
    assert Command.seen(command, %{robot | speed: 0.0}, robot, 2_000).completed == 2
  end

  test "poses leave and goals enter in Open-RMF's frame", c do
    Application.put_env(:bridge, :rmf, map: "B2", frame: {10.0, 0.0, :math.pi() / 2})
    on_exit(fn -> Application.delete_env(:bridge, :rmf) end)

    assert %{"map_name" => "B2", "position" => %{"x" => x, "y" => y}} = data(c)
    assert_in_delta x, 8.0, 1.0e-6
    assert_in_delta y, 1.0, 1.0e-6
    assert %{"success" => true} = navigate(c, 1, {8.0, 1.0, 0.0})
    assert [{:tell, [:mag1], {:goto, x, y, yaw}}] = FakeLive.told(c.live)
    assert_in_delta x, 1.0, 1.0e-3
    assert_in_delta y, 2.0, 1.0e-3
    assert_in_delta yaw, -1.5708, 1.0e-3
  end

  test "what cannot be is refused in one line, and nothing is told", c do
    place = %{destination: %{x: 1, y: 2, yaw: 0}}
    refused = fn answer -> answer["success"] == false and is_binary(answer["msg"]) end

    assert refused.(post(c, "navigate?robot_name=mag9&cmd_id=1", place))
    assert refused.(post(c, "navigate?robot_name=mag1&cmd_id=one", place))
    assert refused.(post(c, "navigate?robot_name=mag1&cmd_id=1", %{destination: %{x: "1"}}))

    assert refused.(
             post(c, "navigate?robot_name=mag1&cmd_id=1", %{destination: %{x: 1.0e9, y: 0}})
           )

    assert refused.(post(c, "start_activity?robot_name=mag1&cmd_id=1", %{activity: "dock"}))
    assert refused.(post(c, "toggle_attach?robot_name=mag1&cmd_id=1", %{toggle: true}))
    assert refused.(get(c, "navigate?robot_name=mag1&cmd_id=1"))

    assert {400, _line} = post(c, "navigate?robot_name=mag1&cmd_id=1", "[1]")
    assert {400, _line} = post(c, "navigate?robot_name=mag1&cmd_id=1", "{")
    big = String.duplicate(" ", 20_000)
    assert {413, _line} = post(c, "navigate?robot_name=mag1&cmd_id=1", big)
    origin = [{~c"origin", ~c"http://elsewhere.example"}]
    assert {403, _line} = post(c, "navigate?robot_name=mag1&cmd_id=1", place, origin)
    assert {404, _line} = ask(:get, {~c"#{c.url}other", []})
    assert FakeLive.told(c.live) == []
  end
end
