defmodule Bridge.Rosbridge do
  @moduledoc """
  Serves programs for ROS the live fleet by rosbridge's protocol, version 2: its topics as standard messages (`Bridge.Ros`),
  services for orders with an answer each (`Bridge.Request`), the parameters `formation` and `spacing`, and topics of orders to
  move, `/ROBOT/cmd_vel`, each of which lasts half a second. Compression is `none` or `cbor`.

  The protocol is that of RobotWebTools/rosbridge_suite, `ROSBRIDGE_PROTOCOL.md`. What is asked of `/rosapi` is answered by
  `Bridge.Rosapi`.
  """
  @behaviour Console.Page.Service
  @behaviour Bridge.Dialect
  alias Bridge.{Connection, Hub, Json, Request, Rosapi}

  @parameters ["formation", "spacing"]
  # Kinds of a topic of orders to move.
  @twists ["geometry_msgs/Twist", "geometry_msgs/TwistStamped"]

  defstruct topics: %{}, asked: %{}

  @typedoc "The kinds and keys of topics by name; what was asked for: of each topic its ids, with what each wants."
  @type t :: %__MODULE__{
          topics: %{String.t() => {type :: String.t(), topic :: term()}},
          asked: %{
            String.t() => %{term() => {every_ms :: non_neg_integer(), form :: :none | :cbor}}
          }
        }

  @impl Console.Page.Service
  def scheme, do: "ws"

  @impl Console.Page.Service
  def feed(source), do: {Hub, Map.put(source, :catalogue, Bridge.Ros)}

  @impl Console.Page.Service
  def answer({:mochiweb_request, _state} = request, page) when is_map(page),
    do: Connection.answer(request, page, __MODULE__, "rosbridge")

  @impl Bridge.Dialect
  def subprotocol(_offered), do: {:ok, nil}

  @impl Bridge.Dialect
  def origin?(origin), do: Connection.here?(origin)

  @impl Bridge.Dialect
  def new(channels), do: {channels(channels, %__MODULE__{}), []}

  @impl Bridge.Dialect
  def channels(channels, state) do
    topics =
      for %{topic: %{key: {topic, _form}, name: name, schema: type}} <- channels,
          into: state.topics,
          do: {name, {type, topic}}

    %{state | topics: topics}
  end

  @impl Bridge.Dialect
  def message(:channels, _channels), do: nil
  def message(:none, {_ns, frame}), do: {:text, frame}
  def message(:cbor, {_ns, frame}), do: {:binary, frame}

  @impl Bridge.Dialect
  def hear({:text, text}, robots, state) do
    case Json.decode(text) do
      {:ok, %{"op" => op} = said} -> op(op, said, robots, state)
      _other -> {state, [wrong("no JSON object with an op", %{})]}
    end
  end

  def hear({:binary, _bytes}, _robots, state),
    do: {state, [wrong("only text is understood", %{})]}

  defp op("subscribe", %{"topic" => name} = said, _robots, state) when is_binary(name) do
    case state.topics[full(name)] do
      nil -> {state, [wrong("there is no topic #{shown(name)}", said)]}
      {type, _topic} -> subscribe(full(name), type, said, state)
    end
  end

  defp op("unsubscribe", %{"topic" => name} = said, _robots, state) when is_binary(name) do
    name = full(name)

    case state.asked do
      %{^name => ids} ->
        ids = if Map.has_key?(said, "id"), do: Map.delete(ids, said["id"]), else: %{}
        stream(name, ids, state)

      _not_asked ->
        {state, []}
    end
  end

  defp op("advertise", %{"topic" => name} = said, robots, state) when is_binary(name) do
    with {:ok, _robot} <- Request.driven(full(name), robots),
         {:kind, true} <- {:kind, Rosapi.like?(said["type"], @twists)} do
      {state, []}
    else
      {:kind, false} -> {state, [wrong("#{shown(name)} takes #{hd(@twists)}", said)]}
      {:error, line} -> {state, [wrong(line, said)]}
    end
  end

  defp op("publish", %{"topic" => name, "msg" => message} = said, robots, state)
       when is_binary(name) do
    with {:ok, robot} <- Request.driven(full(name), robots),
         {:ok, {ahead, left}} <- Request.twist(message) do
      {state, [{:drive, robot, ahead, left}]}
    else
      {:error, line} -> {state, [wrong(line, said)]}
    end
  end

  defp op("call_service", %{"service" => name} = said, robots, state) when is_binary(name),
    do: {state, [call(full(name), said, robots, state)]}

  # What needs no answer here.
  defp op(op, _said, _robots, state) when op in ~w(unadvertise set_level auth status),
    do: {state, []}

  defp op(op, said, _robots, state),
    do: {state, [wrong("#{shown(op)} is not understood, or a field of it is missing", said)]}

  # Some clients leave the first stroke out.
  defp full("/" <> _ = name), do: name
  defp full(name), do: "/" <> name

  defp subscribe(name, type, said, state) do
    every_ms = said["throttle_rate"] || 0

    with {:type, true} <- {:type, said["type"] == nil or Rosapi.like?(said["type"], [type])},
         {:ok, form} <- form(said["compression"]),
         {:rate, true} <- {:rate, is_integer(every_ms) and every_ms >= 0} do
      ids = Map.put(Map.get(state.asked, name, %{}), said["id"], {every_ms, form})
      stream(name, ids, state)
    else
      {:type, false} -> {state, [wrong("#{name} is of type #{type}", said)]}
      {:rate, false} -> {state, [wrong("throttle_rate: expected whole ms", said)]}
      {:error, line} -> {state, [wrong(line, said)]}
    end
  end

  defp form(none) when none in [nil, "none"], do: {:ok, :none}
  defp form("cbor"), do: {:ok, :cbor}
  defp form(other), do: {:error, "compression: expected none or cbor, got #{shown(other)}"}

  # All that a client asks of a topic is one stream: as often as the most eager wants it, as small as one wants it.
  defp stream(name, ids, state) do
    {_type, topic} = state.topics[name]
    before = for {_id, {_ms, form}} <- Map.get(state.asked, name, %{}), do: form
    now = Map.values(ids)
    form = if Enum.any?(now, fn {_ms, form} -> form == :cbor end), do: :cbor, else: :none
    drops = for old <- Enum.uniq(before), now == [] or old != form, do: {:drop, {topic, old}}

    asks =
      if now == [],
        do: [],
        else: [{:ask, {topic, form}, form, now |> Enum.map(&elem(&1, 0)) |> Enum.min()}]

    asked = if now == [], do: Map.delete(state.asked, name), else: Map.put(state.asked, name, ids)
    {%{state | asked: asked}, drops ++ asks}
  end

  defp call("/rosapi/" <> question, said, robots, state) do
    args = arguments(said, Rosapi.fields(question))

    case question do
      "get_param" -> {:values, {:get, said, args}}
      "has_param" -> {:values, {:has, said, args}}
      "set_param" -> set(said, args)
      _other -> said |> response(Rosapi.answer(question, args, known(robots, state)))
    end
  end

  defp call(name, said, robots, _state) do
    case List.keyfind(Request.services(), name, 0) do
      nil ->
        response(said, {:error, "there is no service #{shown(name)}"})

      {_name, fields} ->
        case Request.line(name, arguments(said, Keyword.keys(fields)), robots) do
          {:ok, line} -> {:order, line, {:call, said}}
          {:error, line} -> response(said, {:ok, %{success: false, message: line}})
        end
    end
  end

  defp known(robots, state) do
    topics = for {name, {type, _topic}} <- state.topics, do: {name, type}
    %{topics: Enum.sort(topics), drives: for(robot <- robots, do: "/#{robot}/cmd_vel")}
  end

  # An object, or its values in the order of its fields.
  defp arguments(%{"args" => %{} = args}, _fields), do: args

  defp arguments(%{"args" => args}, fields) when is_list(args),
    do: fields |> Enum.map(&"#{&1}") |> Enum.zip(args) |> Map.new()

  defp arguments(_none, _fields), do: %{}

  defp set(said, args) do
    with {:ok, name} <- Rosapi.parameter(args["name"], @parameters),
         {:ok, value} <- Json.decode("#{args["value"]}") do
      {:values, {:set, said, %{name => value}}}
    else
      {:error, line} -> response(said, {:error, line})
      :error -> response(said, {:error, "value: expected JSON, got #{shown(args["value"])}"})
    end
  end

  @impl Bridge.Dialect
  def answer({:call, said}, {ok?, text}, state) do
    values = %{success: ok? == :ok, message: text |> List.wrap() |> Enum.join("\n")}
    {state, [response(said, {:ok, values})]}
  end

  def answer({:set, said}, {:ok, _line}, state), do: {state, [response(said, {:ok, %{}})]}
  def answer({:set, said}, error, state), do: {state, [response(said, error)]}

  @impl Bridge.Dialect
  def values({:get, said, args}, values, state) do
    value =
      with {:ok, name} <- Rosapi.parameter(args["name"], Map.keys(values)),
           do: Hal.Json.encode!(values[name]),
           else: (_error -> args["default_value"] || args["default"] || "null")

    {state, [response(said, {:ok, %{value: value, successful: true, reason: ""}})]}
  end

  def values({:has, said, args}, values, state) do
    exists = match?({:ok, _name}, Rosapi.parameter(args["name"], Map.keys(values)))
    {state, [response(said, {:ok, %{exists: exists}})]}
  end

  def values({:set, said, asked}, values, state) do
    case Request.set(asked, values) do
      {:ok, line} -> {state, [{:order, line, {:set, said}}]}
      error -> answer({:set, said}, error, state)
    end
  end

  @impl Bridge.Dialect
  def refused(line, state), do: {state, [wrong(line, %{})]}

  # Clients wait for ever for an answer without values.
  defp response(said, {ok?, values}) do
    answer = %{op: "service_response", service: said["service"], values: values}
    answer |> Map.put(:result, ok? == :ok) |> Map.merge(id(said)) |> text()
  end

  defp wrong(line, said),
    do: text(Map.merge(%{op: "status", level: "error", msg: line}, id(said)))

  defp id(%{"id" => id}) when is_binary(id) or is_integer(id), do: %{id: id}
  defp id(_none), do: %{}

  defp text(said), do: {:say, {:text, Hal.Json.encode!(said)}}
  defp shown(term), do: inspect(term, printable_limit: 40, limit: 5)
end
