defmodule Bridge.RosbridgeTest do
  @moduledoc "rosbridge's protocol, by raw sockets, by roslibpy, and by the programs of examples/python."
  use ExUnit.Case, async: false
  import Bridge.Client
  alias Bridge.{Cbor, Judge, Rosbridge}
  alias Console.{FakeLive, Page}
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip: Console.PageCase.no_server() || false

  @examples Path.expand("../../../../examples/python", __DIR__)

  # A fleet whose robots take some ms to answer.
  defmodule Slow do
    defdelegate scene(live), to: FakeLive

    def about(live, robot) do
      receive do
      after
        5 -> FakeLive.about(live, robot)
      end
    end
  end

  defp serve(module \\ FakeLive) do
    {:ok, map} = Sim.Floorplan.open("hospital", 2)
    robots = [{:mag1, {1.0, 2.0}, []}, {:mag2, {3.0, 2.0}, []}]
    {:ok, live} = FakeLive.start_link(FakeLive.of(robots, map: map))

    FakeLive.know(live, :mag1, %{
      pose: [1.5, 2.5],
      heading: :math.pi() / 2,
      speed: 0.25,
      turn: -0.5,
      power: 13.5,
      sonar: [[0.2, 0.0, 0.0, 1.0], [-0.2, 0.0, :math.pi(), 2.0]]
    })

    {:ok, _page, url} =
      Page.start_link(module: module, live: live, robots: [:mag1, :mag2], service: Rosbridge)

    %{live: live, url: url}
  end

  # The next message of a topic.
  defp published(client, topic) do
    await(client, fn
      {1, text} ->
        with {:ok, %{"op" => "publish", "topic" => ^topic, "msg" => message}} <-
               Bridge.Json.decode(text),
             do: message,
             else: (_other -> nil)

      _bytes ->
        nil
    end)
  end

  defp wrong(client, said) do
    {status, client} = client |> say(said) |> op("status")
    assert status["level"] == "error"
    {status["msg"], client}
  end

  defp call(client, service, args) do
    said = %{op: "call_service", service: service, id: "call:#{service}", args: args}
    {answer, client} = client |> say(said) |> op("service_response")
    assert {answer["service"], answer["id"]} == {service, "call:#{service}"}
    {{answer["result"], answer["values"]}, client}
  end

  test "publishes standard messages, in the units and axes of ROS" do
    %{url: url} = serve()
    client = open(url)
    client = say(client, %{op: "subscribe", topic: "/mag1/odom", type: "nav_msgs/msg/Odometry"})
    {odom, client} = published(client, "/mag1/odom")
    assert odom["pose"]["pose"]["position"] == %{"x" => 1.5, "y" => 2.5, "z" => 0.0}
    assert_in_delta odom["pose"]["pose"]["orientation"]["z"], :math.sqrt(0.5), 1.0e-9
    assert odom["twist"]["twist"]["linear"]["x"] == 0.25
    assert odom["twist"]["twist"]["angular"]["z"] == -0.5
    assert length(odom["pose"]["covariance"]) == 36

    %{"secs" => secs, "nsecs" => nsecs, "sec" => secs, "nanosec" => nsecs} =
      odom["header"]["stamp"]

    assert abs(secs - System.os_time(:second)) < 60

    client = say(client, %{op: "subscribe", topic: "mag1/scan"})
    {scan, client} = published(client, "/mag1/scan")
    assert_in_delta scan["angle_increment"], :math.pi(), 1.0e-9
    assert [behind, ahead] = scan["ranges"]
    assert_in_delta behind, 2.2, 1.0e-9
    assert_in_delta ahead, 1.2, 1.0e-9

    client = say(client, %{op: "subscribe", topic: "/tf"})
    {%{"transforms" => [mag1, _mag2]}, client} = published(client, "/tf")
    assert {mag1["header"]["frame_id"], mag1["child_frame_id"]} == {"map", "mag1"}
    assert mag1["transform"]["translation"] == %{"x" => 1.0, "y" => 2.0, "z" => 0.0}

    client = say(client, %{op: "subscribe", topic: "/map"})
    {%{"info" => info, "data" => cells}, client} = published(client, "/map")
    assert length(cells) == info["width"] * info["height"]
    assert Enum.sort(Enum.uniq(cells)) == [0, 100]
    # The last column may stand over the edge.
    edge = -info["width"] * info["resolution"] / 2
    assert_in_delta info["origin"]["position"]["x"], edge, info["resolution"]

    client = say(client, %{op: "subscribe", topic: "/mag1/battery_state"})

    assert {%{"voltage" => 13.5, "percentage" => nil}, _client} =
             published(client, "/mag1/battery_state")
  end

  test "says odometry at each tick, twice as often as what is due at each other one" do
    %{url: url} = serve(Slow)
    client = open(url)
    client = say(client, %{op: "subscribe", topic: "/tf"})
    client = say(client, %{op: "subscribe", topic: "/mag1/odom"})

    {topics, _client} =
      Enum.map_reduce(1..30, client, fn _nth, client ->
        await(client, fn {1, text} -> elem(Bridge.Json.decode(text), 1)["topic"] end)
      end)

    counts = Enum.frequencies(topics)
    assert counts["/mag1/odom"] > 1.5 * counts["/tf"]
  end

  test "makes one stream of what a client asks twice, as rarely as it wants, as CBOR if it wants that" do
    %{url: url, live: live} = serve()
    client = open(url)
    client = say(client, %{op: "subscribe", topic: "/tf", id: "a", throttle_rate: 60_000})
    {_tf, client} = published(client, "/tf")
    # The log tells that time went on without another one.
    client = say(client, %{op: "subscribe", topic: "/mission", id: "m"})

    {seen, client} =
      Enum.map_reduce(1..3, client, fn _nth, client ->
        await(client, fn {1, text} -> elem(Bridge.Json.decode(text), 1)["topic"] end)
      end)

    assert seen == ~w(/mission /mission /mission)
    client = say(client, %{op: "subscribe", topic: "/tf", id: "b", compression: "cbor"})

    {frame, client} = await(client, &with({2, bytes} <- &1, do: bytes, else: (_text -> nil)))
    assert <<0xA3, 0x63, "msg", _::bytes>> = frame
    assert frame =~ "tf" and frame =~ "mag2"
    client = say(client, %{op: "unsubscribe", topic: "/tf", id: "b"})
    client = say(client, %{op: "unsubscribe", topic: "/mission"})
    client = say(client, %{op: "unsubscribe", topic: "/tf"})
    client = say(client, %{op: "unsubscribe", topic: "/tf"})
    {{true, %{"topics" => topics}}, _client} = call(client, "/rosapi/topics", %{})
    assert "/tf" in topics
    assert FakeLive.told(live) == []
  end

  test "answers each call with values, and a wrong one with one line" do
    %{url: url, live: live} = serve()
    client = open(url)
    {answer, client} = call(client, "/goto", %{robot: "mag2", x: 1, y: -2.5})
    assert answer == {true, %{"success" => true, "message" => "accepted"}}
    {answer, client} = call(client, "/formation", ["line", 2])
    assert answer == {true, %{"success" => true, "message" => "accepted"}}
    {answer, client} = call(client, "/stop", %{})
    assert {true, %{"success" => true}} = answer
    {answer, client} = call(client, "/goto", %{robot: "mag9"})
    assert {true, %{"success" => false, "message" => "robot: expected one of" <> _}} = answer
    {answer, client} = call(client, "/nothing", %{})
    assert answer == {false, ~s(there is no service "/nothing")}
    {answer, client} = call(client, "/rosapi/get_param", %{name: "/spacing"})
    assert {true, %{"value" => "1.2"}} = answer
    {answer, client} = call(client, "/rosapi/get_param", %{name: "/colour", default_value: "7"})
    assert {true, %{"value" => "7"}} = answer
    {answer, client} = call(client, "/rosapi/has_param", %{name: "/convoy:formation"})
    assert answer == {true, %{"exists" => true}}
    {answer, client} = call(client, "/rosapi/set_param", %{name: "/spacing", value: "2.5"})
    assert answer == {true, %{}}
    {answer, client} = call(client, "/rosapi/set_param", %{name: "/spacing", value: "[nonsense"})
    assert {false, "value: expected JSON" <> _} = answer
    {answer, _client} = call(client, "/rosapi/set_param", %{name: "/colour", value: "1"})
    assert answer == {false, ~s(there is no parameter "/colour")}

    assert FakeLive.told(live) == [
             {:tell, [:mag2], {:goto, 1.0, -2.5, nil}},
             {:formation, {:line, 2.0}},
             {:tell, :all, :stop},
             {:formation, {:wedge, 2.5}}
           ]
  end

  test "drives by a Twist, stamped or not, and says what is wrong with the rest" do
    %{url: url, live: live} = serve()
    client = open(url)

    for {said, line} <- [
          {%{op: "subscribe", topic: "/nothing"}, ~s(there is no topic "/nothing")},
          {%{op: "subscribe", topic: "/tf", type: "std_msgs/String"},
           "/tf is of type tf2_msgs/TFMessage"},
          {%{op: "subscribe", topic: "/tf", compression: "png"},
           ~s(compression: expected none or cbor, got "png")},
          {%{op: "subscribe", topic: "/tf", throttle_rate: -1},
           "throttle_rate: expected whole ms"},
          {%{op: "advertise", topic: "/mag1/cmd_vel", type: "std_msgs/String"},
           ~s("/mag1/cmd_vel" takes geometry_msgs/Twist)},
          {%{op: "publish", topic: "/cmd_vel", msg: %{}},
           "nothing listens to /cmd_vel here: publish to /mag1/cmd_vel, /mag2/cmd_vel"},
          {%{op: "publish", topic: "/mag1/cmd_vel", msg: [1]},
           "expected a geometry_msgs/Twist: linear.x in m/s and angular.z in rad/s, both below 100"},
          {%{op: "dance"}, ~s("dance" is not understood, or a field of it is missing)},
          {%{op: "publish"}, ~s("publish" is not understood, or a field of it is missing)}
        ],
        reduce: client do
      client ->
        assert {^line, client} = wrong(client, said)
        client
    end
    |> say(%{op: "advertise", topic: "/mag2/cmd_vel", type: "geometry_msgs/msg/TwistStamped"})
    |> say(%{
      op: "publish",
      topic: "mag2/cmd_vel",
      msg: %{twist: %{linear: %{x: 0.25}, angular: %{z: 1}}}
    })

    Swarm.Case.eventually(fn ->
      match?([{:tell, [:mag2], {:move, 0.25, 1.0, _for_s}}], FakeLive.told(live))
    end)
  end

  describe "roslibpy" do
    @describetag skip: Judge.python_why_not("roslibpy")

    test "understands topics, services, parameters and time" do
      %{url: url, live: live} = serve()
      %URI{host: host, port: port} = URI.parse(url)
      said = Judge.python("judge.py", [host, "#{port}"])
      accepted = ~s({"message": "accepted", "success": true})
      assert "/goto #{accepted}" in said and "/estop #{accepted}" in said
      assert "services True std_srvs/Trigger" in said
      assert "formation wedge" in said and "time True" in said
      assert Enum.any?(said, &(&1 =~ ~r/^refused .*there is no service/))
      told = FakeLive.told(live)
      assert {:tell, [:mag1], {:goto, 1.0, 2.0, nil}} in told
      assert {:formation, {:wedge, 2.0}} in told
      assert Enum.any?(told, &match?({:tell, [:mag1], {:move, 0.2, +0.0, _for_s}}, &1))
    end

    test "lets the programs of examples/python do what they say" do
      %{url: url, live: live} = serve()
      %URI{host: host, port: port} = URI.parse(url)
      server = "#{host}:#{port}"

      assert Enum.any?(
               Judge.python("#{@examples}/watch.py", ["3", server]),
               &(&1 =~ "mag2: 3.00, 2.00 m, 29 degrees")
             )

      assert Judge.python("#{@examples}/order.py", ["formation", "wedge", "1.5"], [
               {"CONVOY_ROS", server}
             ]) == ["accepted"]

      assert {:formation, {:wedge, 1.5}} in FakeLive.told(live)
      Judge.python("#{@examples}/drive.py", ["mag2", "0.3", "-0.1", "1", server])
      words = for {:tell, [:mag2], {:move, 0.3, -0.1, _for_s}} <- FakeLive.told(live), do: :word
      assert length(words) in 5..11

      assert [line] = Judge.python("#{@examples}/controller.py", ["mag1", "2", server])
      assert line =~ ~r/^\d+ words, the latest \d+ ms late; at 1.50, 2.50 m$/
      words = for {:tell, [:mag1], {:move, 0.25, +0.0, _for_s}} <- FakeLive.told(live), do: :word
      assert length(words) >= 5
    end
  end

  @tag skip: Judge.python_why_not("cbor2")
  test "writes CBOR that another reads" do
    value = %{
      "numbers" => [
        0,
        23,
        24,
        255,
        256,
        65_535,
        65_536,
        4_294_967_296,
        -1,
        -25,
        -70_000,
        1.5,
        0.1
      ],
      "text" => ["", "ä", String.duplicate("x", 300)],
      "rest" => [nil, true, false, %{}, [], %{"a" => %{"b" => 1}}],
      "long" => Enum.to_list(1..300)
    }

    bytes = value |> Cbor.encode() |> IO.iodata_to_binary() |> Base.encode16()
    script = "import cbor2,json,sys; print(json.dumps(cbor2.loads(bytes.fromhex(sys.argv[1]))))"
    assert [json] = Judge.python("-c", [script, bytes])
    assert Bridge.Json.decode(json) == {:ok, value}
  end
end
