defmodule Bridge.Foxglove do
  @moduledoc """
  Serves Foxglove and Lichtblick the live fleet by Foxglove's WebSocket protocol: its channels (`Bridge.Topics`), the parameters
  `formation` and `spacing`, services for orders with an answer each (`Bridge.Request`), and topics of orders to move,
  `/ROBOT/cmd_vel`, each of which lasts half a second.

  The protocol is that of foxglove/ws-protocol, `docs/spec.md`. It has two names; a server of one name is refused by half of the viewers.
  """
  @behaviour Console.Page.Service
  @behaviour Bridge.Dialect
  alias Bridge.{Connection, Hub, Json, Request}

  @protocols ["foxglove.websocket.v1", "foxglove.sdk.v1"]
  # Where viewers come from, besides this machine: Foxglove's own site, and their desktop programs.
  @viewers ["https://app.foxglove.dev", "file://"]
  @most_advertised 64
  @parameters ["formation", "spacing"]

  @capabilities ["clientPublish", "parameters", "parametersSubscribe", "services"]
  @info 0
  @error 2

  defstruct channels: %{}, subscriptions: %{}, advertised: %{}, watched: []

  @typedoc """
  The keys of channels by id, those of subscriptions by id, the robots that the client's channels drive, and the parameters that it watches.
  """
  @type t :: %__MODULE__{
          channels: %{pos_integer() => Bridge.Broker.key()},
          subscriptions: %{non_neg_integer() => Bridge.Broker.key()},
          advertised: %{non_neg_integer() => atom()},
          watched: [String.t()]
        }

  @impl Console.Page.Service
  def scheme, do: "ws"

  @impl Console.Page.Service
  def feed(source), do: {Hub, Map.put(source, :catalogue, Bridge.Topics)}

  @impl Console.Page.Service
  def answer({:mochiweb_request, _state} = request, page) when is_map(page),
    do: Connection.answer(request, page, __MODULE__, "foxglove")

  @impl Bridge.Dialect
  def subprotocol(offered) do
    case Enum.find(offered, &(&1 in @protocols)) do
      nil -> {:error, "Sec-WebSocket-Protocol must offer #{Enum.join(@protocols, " or ")}"}
      protocol -> {:ok, protocol}
    end
  end

  @impl Bridge.Dialect
  def origin?(origin), do: origin in @viewers or Connection.here?(origin)

  @impl Bridge.Dialect
  def new(channels) do
    info = %{
      op: "serverInfo",
      name: "Convoy",
      capabilities: @capabilities,
      supportedEncodings: ["json"]
    }

    services =
      for {{name, fields}, id} <- Enum.with_index(Request.services(), 1),
          do: service(id, name, fields)

    {channels(channels, %__MODULE__{}),
     [
       text(info),
       {:say, message(:channels, channels)},
       text(%{op: "advertiseServices", services: services})
     ]}
  end

  @impl Bridge.Dialect
  def channels(channels, state) do
    new = Map.new(channels, fn %{id: id, topic: topic} -> {id, topic.key} end)
    %{state | channels: Map.merge(state.channels, new)}
  end

  # `request` and `response` are what viewers read; the two texts are what older ones do.
  defp service(id, name, fields) do
    request = schema(fields)
    response = schema(success: %{"type" => "boolean"}, message: %{"type" => "string"})
    kind = "convoy" <> String.replace(name, "/", ".")

    %{
      id: id,
      name: name,
      type: kind,
      request: form(kind <> ".request", request),
      response: form(kind <> ".response", response),
      requestSchema: request,
      responseSchema: response
    }
  end

  defp form(name, schema),
    do: %{encoding: "json", schemaName: name, schemaEncoding: "jsonschema", schema: schema}

  defp schema(fields),
    do: Hal.Json.encode!(%{type: "object", properties: Map.new(fields)})

  @impl Bridge.Dialect
  def message(:channels, channels) do
    channels =
      for %{id: id, topic: topic} <- channels do
        {name, encoding, schema} = topic.schema || {"", "jsonschema", ""}

        %{
          id: id,
          topic: topic.name,
          encoding: "json",
          schemaName: name,
          schemaEncoding: encoding,
          schema: schema
        }
      end

    {:text, Hal.Json.encode!(%{op: "advertise", channels: channels})}
  end

  def message({:parameters, names}, values),
    do: {:text, Hal.Json.encode!(parameters(Map.take(values, names), nil))}

  def message(subscription, {ns, payload}),
    do: {:binary, [<<1, subscription::32-little, ns::64-little>>, payload]}

  defp parameters(values, id) do
    listed = for {name, value} <- Enum.sort(values), do: parameter(name, value)
    said = %{op: "parameterValues", parameters: listed}
    if id, do: Map.put(said, :id, id), else: said
  end

  # So that 1.0 stays no integer.
  defp parameter(name, value) when is_number(value),
    do: %{name: name, value: value * 1.0, type: "float64"}

  defp parameter(name, value), do: %{name: name, value: value}

  @impl Bridge.Dialect
  def hear({:text, text}, robots, state) do
    case Json.decode(text) do
      {:ok, %{"op" => op} = said} -> op(op, said, robots, state)
      _other -> {state, [wrong("Invalid message: no JSON object with an op")]}
    end
  end

  def hear({:binary, <<1, channel::32-little, payload::bytes>>}, _robots, state) do
    with %{^channel => robot} <- state.advertised,
         {:ok, message} <- Json.decode(payload),
         {:ok, {ahead, left}} <- Request.twist(message) do
      {state, [{:drive, robot, ahead, left}]}
    else
      :error -> {state, [wrong("Invalid message: no JSON on channel #{channel}")]}
      {:error, line} -> {state, [wrong(line)]}
      _not_advertised -> {state, [wrong("Unknown channel ID: #{channel}")]}
    end
  end

  def hear(
        {:binary,
         <<2, service::32-little, call::32-little, size::32-little, encoding::bytes-size(size),
           payload::bytes>>},
        robots,
        state
      ) do
    case {Enum.at(Request.services(), service - 1), encoding} do
      {{name, _fields}, "json"} when service > 0 ->
        {state, [call(name, payload, robots, {service, call})]}

      {nil, _encoding} ->
        {state, [failure(service, call, "Unknown service")]}

      _other when service == 0 ->
        {state, [failure(service, call, "Unknown service")]}

      {_service, _encoding} ->
        {state, [failure(service, call, "Unsupported encoding")]}
    end
  end

  def hear({:binary, <<>>}, _robots, state), do: {state, []}

  def hear({:binary, _other}, _robots, state),
    do: {state, [wrong("Invalid message: unknown opcode, or too short")]}

  defp call(name, payload, robots, {service, call} = of) do
    with {:ok, %{} = request} <- if(payload == "", do: {:ok, %{}}, else: Json.decode(payload)),
         {:ok, line} <- Request.line(name, request, robots) do
      {:order, line, {:call, service, call}}
    else
      {:error, line} -> response(of, {:error, line})
      _no_object -> response(of, {:error, "expected a JSON object"})
    end
  end

  # A failure by the protocol's own word would leave callers waiting in some viewers.
  defp response({service, call}, {ok?, text}) do
    body =
      Hal.Json.encode!(%{success: ok? == :ok, message: text |> List.wrap() |> Enum.join("\n")})

    {:say, {:binary, [<<3, service::32-little, call::32-little, 4::32-little, "json">>, body]}}
  end

  defp failure(service, call, message),
    do: text(%{op: "serviceCallFailure", serviceId: service, callId: call, message: message})

  defp op("subscribe", %{"subscriptions" => [_ | _] = subscriptions}, _robots, state),
    do: all(subscriptions, state, &subscribe/2)

  defp op("unsubscribe", %{"subscriptionIds" => ids}, _robots, state) when is_list(ids),
    do: all(ids, state, &unsubscribe/2)

  defp op("advertise", %{"channels" => channels}, robots, state) when is_list(channels),
    do: all(channels, state, &advertise(&1, robots, &2))

  defp op("unadvertise", %{"channelIds" => ids}, _robots, state) when is_list(ids),
    do: {%{state | advertised: Map.drop(state.advertised, ids)}, []}

  defp op("getParameters", %{"parameterNames" => names} = said, _robots, state)
       when is_list(names),
       do: {state, [{:values, {:get, named(names), id(said)}}]}

  defp op("setParameters", %{"parameters" => parameters} = said, _robots, state)
       when is_list(parameters) do
    asked = for %{"name" => name, "value" => value} <- parameters, do: {name, value}

    case {asked, for({name, _value} <- asked, name not in @parameters, do: name)} do
      {[_ | _], []} -> {state, [{:values, {:set, Map.new(asked), id(said)}}]}
      _other -> {state, [wrong("only #{Enum.join(@parameters, " and ")} can be set")]}
    end
  end

  defp op("subscribeParameterUpdates", %{"parameterNames" => names}, _robots, state)
       when is_list(names),
       do: watch(Enum.uniq(state.watched ++ named(names)), state)

  defp op("unsubscribeParameterUpdates", %{"parameterNames" => names}, _robots, state)
       when is_list(names),
       do: watch(state.watched -- named(names), state)

  defp op(op, _said, _robots, state)
       when op in ~w(subscribeConnectionGraph unsubscribeConnectionGraph),
       do: {state, [wrong("Server does not support connectionGraph capability")]}

  defp op("fetchAsset", _said, _robots, state),
    do: {state, [wrong("Server does not support assets capability")]}

  defp op(op, _said, _robots, state) do
    name = inspect(op, printable_limit: 40, limit: 5)
    {state, [wrong("Invalid message: unknown op #{name}, or a field of it is missing")]}
  end

  defp id(said), do: if(is_binary(said["id"]), do: said["id"])
  defp named([]), do: @parameters
  defp named(names), do: Enum.filter(@parameters, &(&1 in names))

  defp watch([], state), do: {%{state | watched: []}, [{:drop, :parameters}]}

  defp watch(names, state),
    do: {%{state | watched: names}, [{:ask, :parameters, {:parameters, names}, 0}]}

  defp all(items, state, step) do
    {effects, state} =
      Enum.flat_map_reduce(items, state, fn item, state ->
        {state, effects} = step.(item, state)
        {effects, state}
      end)

    {state, effects}
  end

  defp subscribe(%{"id" => id, "channelId" => channel}, state) when id in 0..0xFFFFFFFF//1 do
    key = state.channels[channel]

    cond do
      key == nil ->
        {state, [wrong("Unknown channel ID: #{shown(channel)}")]}

      is_map_key(state.subscriptions, id) or key in Map.values(state.subscriptions) ->
        {state,
         [wrong("Client is already subscribed to channel: #{channel}; ignoring subscription")]}

      true ->
        {put_in(state.subscriptions[id], key), [{:ask, key, id, 0}]}
    end
  end

  defp subscribe(_other, state),
    do: {state, [wrong("Invalid message: a subscription needs id and channelId")]}

  defp unsubscribe(id, state) do
    case Map.pop(state.subscriptions, id) do
      {nil, _same} -> {state, []}
      {key, subscriptions} -> {%{state | subscriptions: subscriptions}, [{:drop, key}]}
    end
  end

  defp advertise(%{"id" => id, "topic" => topic, "encoding" => encoding}, robots, state)
       when id in 0..0xFFFFFFFF//1 and is_binary(topic) do
    cond do
      is_map_key(state.advertised, id) ->
        {state, [wrong("Channel #{id} is advertised already")]}

      map_size(state.advertised) >= @most_advertised ->
        {state, [wrong("at most #{@most_advertised} channels can be advertised")]}

      encoding != "json" ->
        {state, [wrong("Unsupported encoding #{shown(encoding)}: json is understood")]}

      true ->
        case Request.driven(topic, robots) do
          {:ok, robot} -> {put_in(state.advertised[id], robot), []}
          {:error, line} -> {state, [wrong(line)]}
        end
    end
  end

  defp advertise(_other, _robots, state),
    do: {state, [wrong("Invalid message: a channel needs id, topic and encoding")]}

  @impl Bridge.Dialect
  def answer({:call, service, call}, answer, state),
    do: {state, [response({service, call}, answer)]}

  def answer({:set, asked, id}, {:ok, _said}, state),
    do: {state, if(id, do: [text(parameters(asked, id))], else: [])}

  def answer({:set, asked, id}, {:error, line}, state),
    do: {state, [wrong(line) | if(id, do: [{:values, {:get, Map.keys(asked), id}}], else: [])]}

  @impl Bridge.Dialect
  def values({:get, names, id}, values, state),
    do: {state, [text(parameters(Map.take(values, names), id))]}

  def values({:set, asked, _id} = call, values, state) do
    case Request.set(asked, values) do
      {:ok, line} -> {state, [{:order, line, call}]}
      error -> answer(call, error, state)
    end
  end

  @impl Bridge.Dialect
  def refused(line, state), do: {state, [status(@error, line, "drive")]}

  defp wrong(line), do: status(@error, line, nil)

  # One of an id takes the place of the last.
  defp status(level, line, id) when level in @info..@error do
    said = %{op: "status", level: level, message: line}
    text(if id, do: Map.put(said, :id, id), else: said)
  end

  defp text(said), do: {:say, {:text, Hal.Json.encode!(said)}}
  defp shown(term), do: inspect(term, printable_limit: 40, limit: 5)
end
