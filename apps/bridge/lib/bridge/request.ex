defmodule Bridge.Request do
  @moduledoc """
  Makes what a program asks of a fleet the line that a person types for it (`Console.Prompt`), so that both pass the same door.
  Pure.
  """

  @text %{"type" => "string"}
  @number %{"type" => "number"}

  @services [
    stop: [robot: @text],
    estop: [],
    reset: [],
    goto: [robot: @text, x: @number, y: @number],
    formation: [kind: @text, spacing: @number]
  ]

  @typedoc "A service, with the fields of its request, each with its JSON type."
  @type service :: {name :: String.t(), [{field :: atom(), %{String.t() => String.t()}}]}

  @doc "The services; each answers `success` and `message`. Of `stop` the robot, of `formation` the spacing may be missing."
  @spec services() :: [service()]
  def services, do: for({name, fields} <- @services, do: {"/#{name}", fields})

  @doc """
  The line of a call of a service, or one that says what is wrong with it.

      iex> Bridge.Request.line("/goto", %{"robot" => "mag1", "x" => 1, "y" => -2.5}, [:mag1])
      {:ok, "goto mag1 1.0,-2.5"}
      iex> Bridge.Request.line("/stop", %{"robot" => ""}, [:mag1])
      {:ok, "stop"}
      iex> Bridge.Request.line("/formation", %{"kind" => "wedge now"}, [:mag1])
      {:error, ~s(kind: expected a word, got "wedge now")}
      iex> Bridge.Request.line("/goto", %{"robot" => "mag9"}, [:mag1])
      {:error, ~s(robot: expected one of mag1, got "mag9")}
  """
  @spec line(name :: String.t(), map(), [atom()]) :: {:ok, String.t()} | {:error, String.t()}
  def line("/estop", _request, _robots), do: {:ok, "estop"}
  def line("/reset", _request, _robots), do: {:ok, "reset"}

  def line("/stop", request, robots) do
    if Map.get(request, "robot", "") == "",
      do: {:ok, "stop"},
      else: with({:ok, robot} <- robot(request, robots), do: {:ok, "stop #{robot}"})
  end

  def line("/goto", request, robots) do
    with {:ok, robot} <- robot(request, robots),
         {:ok, x} <- number(request, "x"),
         {:ok, y} <- number(request, "y"),
         do: {:ok, "goto #{robot} #{x},#{y}"}
  end

  def line("/formation", request, _robots) do
    with {:ok, kind} <- word(request, "kind") do
      # Zero is what a program sends that has no field without a value.
      if Map.get(request, "spacing", 0) in [0, nil, +0.0],
        do: {:ok, "formation #{kind}"},
        else:
          with(
            {:ok, spacing} <- number(request, "spacing"),
            do: {:ok, "formation #{kind} #{spacing}"}
          )
    end
  end

  @doc """
  The line that sets some of the parameters `formation` and `spacing`, whose values are known as far as `values` has them.

      iex> Bridge.Request.set(%{"spacing" => 2}, %{"formation" => "wedge", "spacing" => 1.0})
      {:ok, "formation wedge 2.0"}
      iex> Bridge.Request.set(%{"formation" => "line"}, %{})
      {:ok, "formation line"}
      iex> Bridge.Request.set(%{"spacing" => 2}, %{})
      {:error, "the formation is not known here: set it, too"}
  """
  @spec set(%{String.t() => term()}, %{String.t() => term()}) ::
          {:ok, String.t()} | {:error, String.t()}
  def set(asked, values) do
    case Map.get(asked, "formation", values["formation"]) do
      nil -> {:error, "the formation is not known here: set it, too"}
      kind -> line("/formation", %{"kind" => kind, "spacing" => asked["spacing"]}, [])
    end
  end

  defp robot(_request, []), do: {:error, "there are no robots here"}

  defp robot(%{"robot" => name}, robots) do
    if Enum.any?(robots, &(Atom.to_string(&1) == name)),
      do: {:ok, name},
      else: expected("robot", "one of #{Enum.join(robots, ", ")}", name)
  end

  defp robot(_request, robots), do: expected("robot", "one of #{Enum.join(robots, ", ")}", nil)

  defp number(request, field) do
    case request do
      %{^field => number} when is_number(number) and abs(number) < 1.0e6 ->
        {:ok, :erlang.float_to_binary(number * 1.0, [:compact, decimals: 6])}

      _other ->
        expected(field, "a number", request[field])
    end
  end

  defp word(request, field) do
    case request do
      %{^field => word} when is_binary(word) ->
        if word =~ ~r/\A[A-Za-z_]{1,30}\z/, do: {:ok, word}, else: expected(field, "a word", word)

      _other ->
        expected(field, "a word", request[field])
    end
  end

  defp expected(field, what, got),
    do: {:error, "#{field}: expected #{what}, got #{inspect(got, printable_limit: 40, limit: 5)}"}

  @doc """
  The robot that a topic of orders to move belongs to: `/mag1/cmd_vel`, and `/cmd_vel` where there is but one.

      iex> {Bridge.Request.driven("/mag1/cmd_vel", [:mag1, :mag2]), Bridge.Request.driven("/cmd_vel", [:mag1])}
      {{:ok, :mag1}, {:ok, :mag1}}
      iex> Bridge.Request.driven("/cmd_vel", [:mag1, :mag2])
      {:error, "nothing listens to /cmd_vel here: publish to /mag1/cmd_vel, /mag2/cmd_vel"}
  """
  @spec driven(topic :: String.t(), [atom()]) :: {:ok, atom()} | {:error, String.t()}
  def driven(topic, robots) do
    topics = for robot <- robots, do: {"/#{robot}/cmd_vel", robot}

    case {List.keyfind(topics, topic, 0), topic, robots} do
      {{_topic, robot}, _, _} ->
        {:ok, robot}

      {nil, "/cmd_vel", [only]} ->
        {:ok, only}

      _none ->
        {:error,
         "nothing listens to #{topic} here: publish to #{Enum.map_join(topics, ", ", &elem(&1, 0))}"}
    end
  end

  @doc """
  The speeds of a message of ROS's kind `geometry_msgs/Twist`, or `TwistStamped`: ahead in m/s, to the left in rad/s. What is
  missing is 0.

      iex> Bridge.Request.twist(%{"linear" => %{"x" => 0.5}, "angular" => %{"z" => -1}})
      {:ok, {0.5, -1.0}}
      iex> Bridge.Request.twist(%{"linear" => 3})
      {:error, "expected a geometry_msgs/Twist: linear.x in m/s and angular.z in rad/s, both below 100"}
  """
  @spec twist(term()) :: {:ok, {float(), float()}} | {:error, String.t()}
  def twist(%{"twist" => %{} = twist}), do: twist(twist)

  def twist(%{} = message) do
    with {:ok, ahead} <- speed(message, "linear", "x"),
         {:ok, left} <- speed(message, "angular", "z"),
         do: {:ok, {ahead, left}},
         else: (:error -> no_twist())
  end

  def twist(_other), do: no_twist()

  defp speed(message, part, axis) do
    with %{} = part <- Map.get(message, part, %{}),
         speed when is_number(speed) and abs(speed) < 100 <- Map.get(part, axis, 0) do
      {:ok, speed * 1.0}
    else
      _other -> :error
    end
  end

  defp no_twist,
    do:
      {:error,
       "expected a geometry_msgs/Twist: linear.x in m/s and angular.z in rad/s, both below 100"}
end
