defmodule Player.Session do
  @moduledoc """
  Speaks Player's protocol with one client of one robot, as functions: what the client says becomes answers in its queue
  (`Player.Queue`) and effects, which `Player.Connection` carries out.

  A request that is not understood, or is for a device that the robot has not, is answered by a NACK; a command by nothing, as
  the protocol has it.

  `set_odom` and `reset_odom` shift the poses of `position2d` for the client that asks, and what it orders there; the robot's
  estimate is not touched, nor what other clients read.
  """
  alias Hal.Pose
  alias Player.{Devices, Queue, Source, Wire}
  alias Sim.Scene

  # Requests that libplayerc makes of all kinds of programs, and that change nothing here: of sonar, ir, ranger (power),
  # position2d (motors on, modes).
  @granted [
    {:sonar, 2},
    {:ir, 2},
    {:ranger, 2},
    {:position2d, 3},
    {:position2d, 4}
  ]
  # Devices that never say anything by themselves.
  @silent [:speech, :simulation, :map]
  @fast 100.0
  @most_text 200

  @enforce_keys [:robot, :body, :devices, :address, :port]
  defstruct @enforce_keys ++
              [queue: %Queue{}, rest: "", open: [], shift: nil, goal: nil, pan: nil]

  @type t :: %__MODULE__{
          robot: atom(),
          body: Source.body(),
          devices: [Wire.device()],
          address: :inet.ip4_address(),
          port: :inet.port_number(),
          queue: Queue.t(),
          rest: binary(),
          open: [Wire.device()],
          shift: Pose.t() | {:to, Pose.t()} | nil,
          goal: Pose.t() | nil,
          pan: float() | nil
        }

  @typedoc """
  What is to be done: hear a device (`:ask`), or no longer (`:drop`); `:drive` so fast ahead (m/s) and to the left (rad/s); carry out
  a line that a person may type (`:order`); say a text (`:say`); get the scene (`:scene`), which is answered by `scene/4`.
  """
  @type effect ::
          {:ask, Wire.device()}
          | {:drop, Wire.device()}
          | {:drive, ahead :: float(), left :: float()}
          | {:order, line :: String.t()}
          | {:say, String.t()}
          | {:scene, Wire.heard()}

  @doc "A client of a robot that is served at this address and port."
  @spec new(atom(), Source.body(), :inet.ip4_address(), :inet.port_number()) :: t()
  def new(robot, body, address, port) do
    devices = Devices.of(body)
    %__MODULE__{robot: robot, body: body, devices: devices, address: address, port: port}
  end

  @doc "What the client has said; the error is for what no client says."
  @spec hear(t(), binary(), at_s :: float()) :: {:ok, t(), [effect()]} | :error
  def hear(session, bytes, at_s) do
    with {:ok, messages, rest} <- Wire.cut(session.rest <> bytes) do
      {session, effects} =
        Enum.reduce(messages, {%{session | rest: rest}, []}, fn message, {session, effects} ->
          {session, more} = heard(message, Wire.values(message), session, at_s)
          {session, [more | effects]}
        end)

      {:ok, session, effects |> Enum.reverse() |> Enum.concat()}
    end
  end

  defp heard(%{device: {:player, 0}, kind: :req} = message, {:ok, values}, session, at_s),
    do: player(message.subtype, values, session, at_s)

  defp heard(%{kind: :req} = message, {:ok, values}, session, at_s) do
    if message.device in session.devices,
      do: request(message, values, session, at_s),
      else: {nack(session, message, at_s), []}
  end

  defp heard(%{kind: :cmd, device: device} = message, {:ok, values}, session, _at_s) do
    if device in session.devices,
      do: command({elem(device, 0), message.subtype}, values, session),
      else: {session, []}
  end

  # Commands and what only servers say have no answer.
  defp heard(%{device: {:player, _}} = message, _values, session, at_s),
    do: {nack(session, message, at_s), []}

  defp heard(%{kind: :req} = message, :error, session, at_s),
    do: {nack(session, message, at_s), []}

  defp heard(_message, _values, session, _at_s), do: {session, []}

  # DEVLIST, DRIVERINFO, DEV, DATA, DATAMODE, ADD_REPLACE_RULE.
  defp player(1, _none, session, at_s) do
    devices = for device <- session.devices, do: address(session, device)
    {ack(session, {:player, 0}, 1, %{devices: devices}, at_s), []}
  end

  defp player(2, %{address: address}, session, at_s) do
    case device(session, address) do
      nil -> {answer(session, {:player, 0}, :nack, 2, %{}, at_s), []}
      _device -> {ack(session, {:player, 0}, 2, driver(session, address), at_s), []}
    end
  end

  defp player(3, %{address: address, access: access}, session, at_s) do
    case {device(session, address), access} do
      {device, 1} when device != nil -> opened(session, device, address, at_s)
      {device, 2} when device != nil -> closed(session, device, address, at_s)
      _unknown -> refused(session, address, at_s)
    end
  end

  defp player(4, _none, session, at_s) do
    bytes = bytes(session, {:player, 0}, :ack, 4, %{}, at_s)
    {%{session | queue: Queue.round(session.queue, bytes)}, []}
  end

  defp player(5, %{mode: mode}, session, at_s) when mode in [1, 2] do
    queue = Queue.mode(session.queue, if(mode == 1, do: :push, else: :pull))
    {ack(%{session | queue: queue}, {:player, 0}, 5, %{}, at_s), []}
  end

  defp player(10, %{rule: rule} = values, session, at_s) when rule in 0..2 do
    codes = {values.interf, values.index, values.type, values.subtype}
    queue = Queue.rule(session.queue, codes, Enum.at([:accept, :replace, :ignore], rule))
    {ack(%{session | queue: queue}, {:player, 0}, 10, %{}, at_s), []}
  end

  defp player(subtype, _values, session, at_s),
    do: {answer(session, {:player, 0}, :nack, subtype, %{}, at_s), []}

  defp opened(session, device, address, at_s) do
    values = session |> driver(address) |> Map.put(:access, 1)
    answered = ack(session, {:player, 0}, 3, values, at_s)

    if device in session.open or elem(device, 0) in @silent,
      do: {answered, []},
      else: {%{answered | open: [device | session.open]}, [{:ask, device}]}
  end

  defp closed(session, device, address, at_s) do
    values = session |> driver(address) |> Map.put(:access, 2)
    answered = ack(session, {:player, 0}, 3, values, at_s)
    drops = if device in session.open, do: [{:drop, device}], else: []
    {%{answered | open: List.delete(session.open, device)}, drops}
  end

  defp refused(session, address, at_s) do
    values = %{address: address, access: 3, driver: ""}
    {answer(session, {:player, 0}, :nack, 3, values, at_s), []}
  end

  defp driver(session, address) do
    address = %{address | host: Wire.host(session.address), robot: session.port}
    %{address: address, driver: Devices.driver() <> <<0>>}
  end

  defp address(session, device) do
    {interface, index, _type, _subtype} = Wire.codes(device, :data, 0)

    %{
      host: Wire.host(session.address),
      robot: session.port,
      interf: interface,
      index: index
    }
  end

  defp device(session, %{interf: interface, index: index}) do
    Enum.find(session.devices, fn device ->
      match?({^interface, ^index, _, _}, Wire.codes(device, :data, 0))
    end)
  end

  defp request(%{device: {interface, _index} = device, subtype: subtype}, _values, session, at_s)
       when {interface, subtype} in @granted,
       do: {ack(session, device, subtype, %{}, at_s), []}

  # Motors that are off are wheels that stand.
  defp request(%{device: {:position2d, 0} = device, subtype: 2}, %{on: on}, session, at_s) do
    stop = if on == 0, do: [{:order, "stop #{session.robot}"}], else: []
    {ack(%{session | goal: nil}, device, 2, %{}, at_s), stop}
  end

  defp request(%{device: {:position2d, 0} = device, subtype: 5}, values, session, at_s),
    do: {ack(%{session | shift: {:to, pose(values.pose)}}, device, 5, %{}, at_s), []}

  defp request(%{device: {:position2d, 0} = device, subtype: 6}, _none, session, at_s),
    do: {ack(%{session | shift: {:to, Pose.new(0, 0)}}, device, 6, %{}, at_s), []}

  defp request(%{device: {interface, 0}} = message, _values, session, _at_s)
       when interface in [:simulation, :map],
       do: {session, [{:scene, message}]}

  defp request(%{device: device, subtype: subtype} = message, _values, session, at_s) do
    case Devices.answer(device, subtype, session.body) do
      {:ok, values} -> {ack(session, device, subtype, values, at_s), []}
      :error -> {nack(session, message, at_s), []}
    end
  end

  @doc "Answers a request that needed the scene."
  @spec scene(t(), Wire.heard(), Scene.t(), at_s :: float()) :: t()
  def scene(session, message, scene, at_s) do
    {:ok, values} = Wire.values(message)

    case Devices.seen(message.device, message.subtype, values, scene) do
      {:ok, values} -> ack(session, message.device, message.subtype, values, at_s)
      :error -> nack(session, message, at_s)
    end
  end

  defp command({:position2d, 1}, %{speed: {ahead, _aside, left}, on: on}, session)
       when abs(ahead) < @fast and abs(left) < @fast do
    {ahead, left} = if on == 0, do: {0.0, 0.0}, else: {ahead, left}
    {%{session | goal: nil}, [{:drive, ahead, left}]}
  end

  # Programs say where to go ten times a second; the robot is told once.
  defp command({:position2d, 2}, %{pose: {x, y, yaw}}, session)
       when abs(x) < 1.0e5 and abs(y) < 1.0e5 and abs(yaw) < @fast do
    goal = inward(session.shift, Pose.new(x, y, yaw))

    cond do
      goal == session.goal -> {session, []}
      # Where the client's zero is becomes known with the next reading.
      goal == :unknown -> {session, []}
      true -> {%{session | goal: goal}, [{:order, goto(session.robot, goal)}]}
    end
  end

  # Only what has changed; zoom and tilt are the driver's.
  defp command({:ptz, 1}, %{pan: pan}, session) when abs(pan) < @fast do
    most =
      with %{camera: %{max_pan: most}} <- session.body.profile,
           do: most,
           else: (_unknown -> @fast)

    pan = pan |> Float.round(2) |> max(-most) |> min(most)

    if pan == session.pan,
      do: {session, []},
      else: {%{session | pan: pan}, [{:order, "#{session.robot} look:#{number(pan)}"}]}
  end

  defp command({:speech, 1}, %{text: text}, session) do
    text = text |> String.split(<<0>>) |> hd()

    if String.valid?(text) and text =~ ~r/\A[[:print:]]+\z/u,
      do: {session, [{:say, String.slice(text, 0, @most_text)}]},
      else: {session, []}
  end

  defp command(_other, _values, session), do: {session, []}

  defp goto(robot, goal),
    do: "#{robot} goto:#{number(goal.x)}:#{number(goal.y)}:#{number(goal.heading)}"

  defp number(number), do: :erlang.float_to_binary(number * 1.0, [:compact, decimals: 4])

  @doc "A reading of a device, as it was written for all clients (`Player.Readings`)."
  @spec data(t(), Wire.device(), binary()) :: t()
  def data(%{shift: nil} = session, device, bytes), do: queued(session, device, bytes)

  # The pose is what comes first behind the header.
  def data(session, {:position2d, 0} = device, bytes) do
    <<head::binary-size(32), x::float, y::float, heading::float, rest::binary>> = bytes
    pose = Pose.new(x, y, heading)
    session = %{session | shift: shift(session.shift, pose)}
    pose = Pose.compose(session.shift, pose)

    bytes =
      <<head::binary, pose.x * 1.0::float, pose.y * 1.0::float, pose.heading * 1.0::float,
        rest::binary>>

    queued(session, device, bytes)
  end

  def data(session, device, bytes), do: queued(session, device, bytes)

  defp queued(session, device, bytes) do
    codes = Wire.codes(device, :data, 1)
    bytes = [Wire.from(session.address, session.port), bytes]
    %{session | queue: Queue.data(session.queue, codes, bytes)}
  end

  # From the map to the client's poses, so that the robot now is where the client says.
  defp shift({:to, place}, pose),
    do: Pose.compose(place, Pose.relative(pose, Pose.new(0, 0)))

  defp shift(known, _pose), do: known

  defp pose({x, y, yaw}), do: Pose.new(x, y, yaw)

  defp inward(nil, goal), do: goal
  defp inward({:to, _pose}, _goal), do: :unknown
  defp inward(shift, goal), do: Pose.relative(shift, goal)

  @doc "What is to be written now, `[]` for nothing."
  @spec take(t()) :: {iodata(), t()}
  def take(session) do
    {bytes, queue} = Queue.take(session.queue)
    {bytes, %{session | queue: queue}}
  end

  defp ack(session, device, subtype, values, at_s),
    do: answer(session, device, :ack, subtype, values, at_s)

  defp nack(session, message, at_s),
    do: answer(session, message.device, :nack, message.subtype, %{}, at_s)

  defp answer(session, device, kind, subtype, values, at_s) do
    bytes = bytes(session, device, kind, subtype, values, at_s)
    %{session | queue: Queue.answer(session.queue, bytes)}
  end

  defp bytes(session, device, kind, subtype, values, at_s) do
    [Wire.from(session.address, session.port), Wire.encode(device, kind, subtype, values, at_s)]
  end
end
