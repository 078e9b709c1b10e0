defmodule Bridge.Rmf do
  @moduledoc """
  Serves the fleet adapter that comes with Open-RMF's demos as its fleet manager: HTTP and JSON, below
  `/open-rmf/rmf_demos_fm`. With it a fleet is one of Open-RMF's, and no ROS is needed here.

  The contract is that of open-rmf/rmf_demos, `rmf_demos_fleet_adapter`. Navigating and stopping are orders of a person
  (`Console.Page.Line`); docking, cleaning and carts are refused. The configuration names the level of Open-RMF's map, and the pose
  of our map's origin in it:

      config :bridge, rmf: [map: "L1", frame: {0.0, 0.0, 0.0}]
  """
  @behaviour Console.Page.Service
  # Debian's package; without it there is no server.
  @compile {:no_warn_undefined, [:mochiweb_request]}
  require Logger
  import Console.Page.Http
  alias Bridge.Rmf.Manager
  alias Console.Page.{Door, Line}
  alias Hal.Pose

  @prefix "/open-rmf/rmf_demos_fm/"
  @most_bytes 16_384
  @metres {:number, -1.0e5, 1.0e5, "m"}
  @frame {:tuple, [@metres, @metres, {:number, -7.0, 7.0, "rad"}], "{x, y, yaw}"}
  @table [
    map: [{:text, "the name of a level"}, default: "L1"],
    frame: [@frame, default: {0.0, 0.0, 0.0}]
  ]

  @impl Console.Page.Service
  def scheme, do: "http"

  @impl Console.Page.Service
  def feed(source), do: {Manager, source}

  @impl Console.Page.Service
  def answer({:mochiweb_request, _state} = request, page) do
    with :ok <- admitted(request, page, fn _origin -> false end, ["GET", "POST"]),
         {:ok, name} <- call(request),
         {:ok, body} <- body(request) do
      Door.note(page.door, :busy)
      manager = Manager.of(page.page)
      robots = page.robots.()
      asked = %{request: request, body: body, manager: manager, robots: robots, who: who(request)}
      reply(request, answer_call(name, get(request, :method), asked))
      Door.note(page.door, :idle)
    else
      {status, line} -> say(request, status, line)
    end
  end

  # The adapter says no slash at the end, others do.
  defp call(request) do
    path = request |> get(:path) |> List.to_string()

    case String.split(path, @prefix) do
      ["", name] -> {:ok, String.trim_trailing(name, "/")}
      _other -> {404, "there is no #{path}; what Open-RMF asks is below #{@prefix}"}
    end
  end

  defp body(request) do
    with :POST <- get(request, :method),
         {:length, length} when length in 0..@most_bytes <- {:length, get(request, :body_length)},
         bytes when is_binary(bytes) <- :mochiweb_request.recv_body(@most_bytes, request),
         {:ok, %{} = body} <- Bridge.Json.decode(bytes) do
      {:ok, body}
    else
      :GET ->
        {:ok, %{}}

      {:length, _length} ->
        {413, "expected a body of at most #{@most_bytes} bytes, with its length"}

      _other ->
        {400, "expected a body that is a JSON object"}
    end
  end

  defp who(request), do: "rmf #{get(request, :peer)}"

  defp answer_call("status", :GET, asked) do
    case query(asked.request, "robot_name") do
      nil ->
        all = for seen <- Manager.robots(asked.manager, :all), known?(seen), do: robot(seen)
        %{success: true, msg: "", data: %{all_robots: all}, all_robots: all}

      name ->
        case Manager.robots(asked.manager, name) do
          [{%{pose: %Pose{}}, _told} = seen] -> %{success: true, msg: "", data: robot(seen)}
          [_lost] -> refused("#{name} does not know where it is")
          [] -> refused("#{name} is not heard")
        end
    end
  end

  defp answer_call("navigate", :POST, asked) do
    with {:ok, robot} <- robot_named(asked),
         {:ok, id} <- number_of(asked, "cmd_id"),
         {:ok, goal} <- destination(asked.body) do
      goal = inward(goal)
      line = "#{robot} goto:#{metres(goal.x)}:#{metres(goal.y)}:#{metres(goal.heading)}"
      ordered(asked, robot, id, goal, line)
    end
  end

  defp answer_call("stop_robot", :GET, asked) do
    with {:ok, robot} <- robot_named(asked),
         {:ok, id} <- number_of(asked, "stop_cmd_id"),
         do: ordered(asked, robot, id, :stop, "stop #{robot}")
  end

  defp answer_call("toggle_teleop", :POST, asked) do
    with {:ok, robot} <- robot_named(asked) do
      if asked.body["toggle"] == true,
        do: order(asked, "stop #{robot}"),
        else: %{success: true, msg: "", data: %{}}
    end
  end

  defp answer_call(name, :POST, _asked) when name in ["start_activity", "toggle_attach"],
    do: refused("#{name}: these robots neither dock, clean nor carry")

  defp answer_call(name, method, _asked), do: refused("#{method} #{name} is not known here")

  defp known?({%{pose: pose}, _told}), do: pose != nil

  defp robot({robot, told}) do
    pose = outward(robot.pose)

    Map.merge(told, %{
      robot_name: robot.id,
      map_name: setting(:map),
      position: %{x: pose.x, y: pose.y, yaw: pose.heading},
      # The contract has no word for not known; robots measure volts, which do not say how much is left.
      battery: 100,
      destination_arrival: nil
    })
  end

  # The robot is told before the manager is: an order that it refuses is asked for again.
  defp ordered(asked, robot, id, goal, line) do
    case Manager.asked(asked.manager, robot, id, goal) do
      :same ->
        %{success: true, msg: "", data: %{}}

      :new ->
        answer = order(asked, line)
        if answer.success, do: Manager.given(asked.manager, robot, id)
        answer
    end
  end

  defp order(asked, line) do
    given_us = System.monotonic_time(:microsecond)

    answer =
      with {:ok, order} <-
             Line.order(line, given_us, asked.robots, Manager.source(asked.manager)),
           do: Swarm.by(asked.who, fn -> order.run.(0) end)

    {told, text} = answer
    text = text |> List.wrap() |> Enum.join("; ")
    level = if told == :ok, do: :info, else: :warning
    Logger.log(level, fn -> "#{asked.who}: #{line}: #{text}" end)
    if told == :ok, do: %{success: true, msg: text, data: %{}}, else: refused(text)
  end

  defp robot_named(asked) do
    name = query(asked.request, "robot_name")

    case Enum.find(asked.robots, &(Atom.to_string(&1) == name)) do
      nil -> refused("robot_name: expected one of #{Enum.join(asked.robots, ", ")}, got #{name}")
      robot -> {:ok, robot}
    end
  end

  defp number_of(asked, key) do
    case Integer.parse(query(asked.request, key) || "") do
      {id, ""} when abs(id) < 1_000_000_000 -> {:ok, id}
      _other -> refused("#{key}: expected a whole number")
    end
  end

  defp destination(%{"destination" => %{"x" => x, "y" => y} = place}) do
    yaw = place["yaw"] || 0

    if Enum.all?([x, y, yaw], &(is_number(&1) and abs(&1) < 1.0e5)),
      do: {:ok, Pose.new(x, y, yaw)},
      else: refused("destination: expected numbers")
  end

  defp destination(_body), do: refused("destination: expected x, y and yaw")

  defp refused(line), do: %{success: false, msg: line, data: %{}}

  # Poses leave, and goals enter, in Open-RMF's frame.
  defp outward(pose), do: Pose.compose(frame(), pose)
  defp inward(pose), do: Pose.relative(frame(), pose)

  defp frame do
    {x, y, yaw} = setting(:frame)
    Pose.new(x, y, yaw)
  end

  defp setting(key) do
    :bridge
    |> Application.get_env(:rmf, [])
    |> Hal.Options.check!(@table, "config :bridge, rmf")
    |> Keyword.fetch!(key)
  end

  defp metres(number), do: :erlang.float_to_binary(number * 1.0, [:compact, decimals: 4])

  defp reply(request, answer) do
    json = [{"Content-Type", "application/json"}]
    respond(request, 200, json, Hal.Json.encode!(answer))
  end
end
