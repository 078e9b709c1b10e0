defmodule Bridge.Rosapi do
  @moduledoc """
  Answers what clients of rosbridge ask of `/rosapi`: which topics, services and parameters there are. Pure. Definitions of message
  kinds are not among it.
  """
  alias Bridge.Request

  @node "/convoy"
  @twist "geometry_msgs/Twist"
  @questions [
    topics: [],
    topic_type: [:topic],
    topics_for_type: [:type],
    services: [],
    service_type: [:service],
    services_for_type: [:type],
    nodes: [],
    node_details: [:node],
    action_servers: [],
    get_param: [:name, :default_value],
    set_param: [:name, :value],
    has_param: [:name],
    get_param_names: [],
    get_time: []
  ]
  @parameters ["/formation", "/spacing"]

  @typedoc "The topics that are said, with their kinds, and those of orders to move."
  @type known :: %{topics: [{name :: String.t(), type :: String.t()}], drives: [String.t()]}

  @doc "The fields of a question, in their order."
  @spec fields(String.t()) :: [atom()]
  def fields(question) do
    Enum.find_value(@questions, [], fn {name, fields} -> if "#{name}" == question, do: fields end)
  end

  @doc """
  The answer to a question; the error is one line.

      iex> known = %{topics: [{"/tf", "tf2_msgs/TFMessage"}], drives: ["/mag1/cmd_vel"]}
      iex> Bridge.Rosapi.answer("topics", %{}, known)
      {:ok, %{topics: ["/tf", "/mag1/cmd_vel"], types: ["tf2_msgs/TFMessage", "geometry_msgs/Twist"]}}
      iex> Bridge.Rosapi.answer("topics_for_type", %{"type" => "tf2_msgs/msg/TFMessage"}, known)
      {:ok, %{topics: ["/tf"]}}
      iex> Bridge.Rosapi.answer("topic_type", %{"topic" => "/nothing"}, known)
      {:ok, %{type: ""}}
      iex> Bridge.Rosapi.answer("message_details", %{}, known)
      {:error, ~s("message_details" is not answered here)}
  """
  @spec answer(question :: String.t(), map(), known()) :: {:ok, map()} | {:error, String.t()}
  def answer("topics", _args, known) do
    {topics, types} = Enum.unzip(topics(known))
    {:ok, %{topics: topics, types: types}}
  end

  def answer("topic_type", args, known),
    do: {:ok, %{type: type(topics(known), args["topic"])}}

  def answer("topics_for_type", args, known),
    do: {:ok, %{topics: of_type(topics(known), args["type"])}}

  def answer("services", _args, _known),
    do: {:ok, %{services: for({name, _type} <- services(), do: name)}}

  def answer("service_type", args, _known),
    do: {:ok, %{type: type(services(), args["service"])}}

  def answer("services_for_type", args, _known),
    do: {:ok, %{services: of_type(services(), args["type"])}}

  def answer("nodes", _args, _known), do: {:ok, %{nodes: [@node]}}

  def answer("node_details", _args, known) do
    publishing = for {name, _type} <- known.topics, do: name
    services = for {name, _type} <- services(), do: name
    {:ok, %{publishing: publishing, subscribing: known.drives, services: services}}
  end

  def answer("action_servers", _args, _known), do: {:ok, %{action_servers: []}}
  def answer("get_param_names", _args, _known), do: {:ok, %{names: @parameters}}

  def answer("get_time", _args, _known),
    do: {:ok, %{time: Bridge.Ros.stamp(System.os_time(:nanosecond))}}

  def answer(question, _args, _known),
    do: {:error, "#{inspect(question, printable_limit: 40)} is not answered here"}

  defp topics(known), do: known.topics ++ for(name <- known.drives, do: {name, @twist})

  defp services do
    of_fleet =
      for {"/" <> name = service, fields} <- Request.services(),
          do:
            {service,
             if(fields == [], do: "std_srvs/Trigger", else: "convoy/#{String.capitalize(name)}")}

    of_fleet ++
      for {name, _fields} <- @questions,
          do: {"/rosapi/#{name}", "rosapi/#{Macro.camelize("#{name}")}"}
  end

  defp type(known, name) do
    case List.keyfind(known, name, 0) do
      {_name, type} -> type
      nil -> ""
    end
  end

  defp of_type(known, asked), do: for({name, type} <- known, like?(asked, [type]), do: name)

  @doc """
  Whether a kind is one of these, by the names of ROS 1 or ROS 2.

      iex> for kind <- ["geometry_msgs/msg/Twist", "geometry_msgs/Twist", "std_msgs/Twist", nil],
      ...>     do: Bridge.Rosapi.like?(kind, ["geometry_msgs/Twist"])
      [true, true, false, false]
  """
  @spec like?(term(), [String.t()]) :: boolean()
  def like?(kind, types) when is_binary(kind) do
    parts = String.split(kind, "/")
    length(parts) in 2..3 and "#{hd(parts)}/#{List.last(parts)}" in types
  end

  def like?(_none, _types), do: false

  @doc """
  The parameter of a name, as ROS 1 (`/spacing`) or ROS 2 (`/convoy:spacing`) writes it, if it is one of these.

      iex> for name <- ["/spacing", "spacing", "/convoy:spacing"], do: Bridge.Rosapi.parameter(name, ["spacing"])
      [{:ok, "spacing"}, {:ok, "spacing"}, {:ok, "spacing"}]
      iex> Bridge.Rosapi.parameter("/colour", ["spacing"])
      {:error, ~s(there is no parameter "/colour")}
  """
  @spec parameter(term(), [String.t()]) :: {:ok, String.t()} | {:error, String.t()}
  def parameter(name, parameters) when is_binary(name) do
    last = name |> String.split([":", "/"]) |> List.last()
    if last in parameters, do: {:ok, last}, else: none(name)
  end

  def parameter(name, _parameters), do: none(name)

  defp none(name),
    do: {:error, "there is no parameter #{inspect(name, printable_limit: 40, limit: 5)}"}
end
