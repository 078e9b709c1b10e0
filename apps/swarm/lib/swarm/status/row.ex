defmodule Swarm.Status.Row do
  @moduledoc false
  # Packs a robot's status into a row of the blackboard, for nodes that cannot reach it: small, in whole numbers (mm,
  # mrad, mm/s) and text. Pure. It omits the normal case: wheels that may turn, devices that are present, parts that do
  # not hang. `uncertainty` is that of the pose in mm, if known.
  alias Hal.Pose
  alias Swarm.Status
  alias Swarm.Wire
  alias Swarm.Blackboard

  # Longer than any name: text from outside is not printed at any length.
  @words 80
  # In mm: a robot that is less certain than 100 km reports this.
  @unsure_mm 100_000_000

  @doc "A status as it is sent."
  @spec encode(Status.t()) :: map()
  def encode(%Status{} = status) do
    {number, members} = status.view || {0, []}

    %{
      node: Atom.to_string(status.node),
      state: Atom.to_string(status.state),
      by: status.by && Atom.to_string(status.by),
      pose: pose(status.pose),
      speed: status.speed && round(status.speed * 1000),
      limits: texts(status.limits),
      estop: status.estop,
      leader: status.leader && Atom.to_string(status.leader),
      power: status.power,
      offline: texts(for {device, {:offline, _reason}} <- status.health, do: device),
      view: {number, texts(members)},
      # Nearly always none, while it may hear many.
      deaf_to: texts(members -- [status.robot | status.hears]),
      rejected: status.rejected |> Map.values() |> Enum.sum(),
      age_ms: status.age_ms
    }
    |> arming(status.arming)
    |> offline(status)
    |> given(:fault, status.fault)
    |> given(:estop_file, status.estop_file && short(status.estop_file))
    |> given(:blocked_by, status.blocked_by)
    |> hung(status.hung)
    |> given(:crashed, status.crashed && String.slice(status.crashed, 0, 3 * @words))
    |> uncertain(status.uncertainty)
    |> given(:frame, status.frame && Status.Frame.encode(status.frame))
    |> given(:epoch, status.epoch)
    |> given(:head, Status.Sight.encode(status.head))
    |> given(:sees, Status.Sight.encode(status.sees))
    |> given(:says, status.says && short(status.says))
  end

  defp hung(row, nil), do: row

  defp hung(row, {what, where, ago_ms}),
    do: Map.put(row, :hung, {Atom.to_string(what), where, ago_ms})

  defp uncertain(row, nil), do: row

  defp uncertain(row, metres),
    do: Map.put(row, :uncertainty, min(mm(metres), @unsure_mm))

  # A mission's own words may be as long as it likes.
  defp short(text) when is_binary(text),
    do: text |> String.codepoints() |> Enum.take(@words) |> Enum.join()

  defp short(_other), do: nil

  defp given(row, _key, nil), do: row
  defp given(row, key, value), do: Map.put(row, key, value)

  defp offline(row, %{offline: lines}) when lines == %{}, do: row

  # In the order of the names.
  defp offline(row, %{health: health, offline: lines}) do
    words = for {device, {:offline, _reason}} <- health, do: Map.get(lines, device, "")
    Map.put(row, :words, words)
  end

  defp arming(row, :disarmed), do: Map.put(row, :arming, "disarmed")
  defp arming(row, {:error, _reason}), do: Map.put(row, :arming, "error")
  defp arming(row, _armed_or_unknown), do: row

  defp pose(nil), do: nil
  defp pose(pose), do: {mm(pose.x), mm(pose.y), mm(pose.heading)}
  defp mm(number), do: round(number * 1000)
  defp texts(names), do: Enum.map(names, &Atom.to_string/1)

  @doc "The status in a row of this age; `:error` for anything else."
  @spec decode(atom(), term(), age_ms :: non_neg_integer()) :: {:ok, Status.t()} | :error
  def decode(robot, row, age_ms) do
    with %{state: state, by: by, pose: pose, speed: speed, limits: limits, estop: estop} <- row,
         %{node: node, leader: leader, power: power, offline: offline, view: view} <- row,
         %{deaf_to: deaf_to, rejected: rejected, age_ms: was_ms} <- row,
         {number, members} <- view,
         {:ok, arming} <- armed(Map.get(row, :arming)),
         words = Map.get(row, :words, []),
         fault = Map.get(row, :fault),
         {:ok, blocked_by} <- text(Map.get(row, :blocked_by)),
         {:ok, hung} <- hangs(Map.get(row, :hung), age_ms),
         {:ok, uncertainty} <- metres(Map.get(row, :uncertainty)),
         {:ok, says} <- text(Map.get(row, :says), 4 * @words),
         {:ok, crashed} <- text(Map.get(row, :crashed), 12 * @words),
         {:ok, estop_file} <- text(Map.get(row, :estop_file), 4 * @words),
         epoch = Map.get(row, :epoch),
         true <- epoch == nil or Wire.number?(epoch),
         true <- Enum.all?([limits, offline, members, deaf_to, words], &texts?/1),
         true <- Enum.all?([node, state], &is_binary/1),
         true <- Enum.all?([by, leader, fault], &(&1 == nil or is_binary(&1))),
         true <- Enum.all?([rejected, number], &Wire.number?/1) and is_boolean(estop),
         true <- speed == nil or Wire.number?(speed),
         true <- pose == nil or Wire.pose?(pose),
         true <- power == nil or is_number(power),
         true <- was_ms == nil or Wire.number?(was_ms) do
      members = names(members)

      {:ok,
       %Status{
         robot: robot,
         from: :row,
         node: Blackboard.Codec.word(node),
         state: Blackboard.Codec.word(state),
         by: by && Blackboard.Codec.word(by),
         pose: pose && place(pose),
         uncertainty: uncertainty,
         frame: Status.Frame.decode(Map.get(row, :frame)),
         epoch: epoch,
         head: Status.Sight.decode_head(Map.get(row, :head)),
         sees: Status.Sight.decode(Map.get(row, :sees)),
         speed: speed && speed / 1000,
         limits: Enum.map(limits, &Blackboard.Codec.word/1),
         estop: estop,
         estop_file: estop_file,
         arming: arming,
         leader: leader && Blackboard.Codec.word(leader),
         says: says,
         blocked_by: blocked_by,
         hung: hung,
         crashed: crashed,
         power: power,
         health: Map.new(offline, &{Blackboard.Codec.word(&1), {:offline, :unknown}}),
         offline:
           for(
             {name, line} <- Enum.zip(offline, words),
             into: %{},
             do: {Blackboard.Codec.word(name), line}
           ),
         fault: fault,
         hears: members -- [robot | names(deaf_to)],
         view: {number, members},
         rejected: if(rejected > 0, do: %{all: rejected}, else: %{}),
         age_ms: (was_ms || 0) + age_ms
       }}
    else
      _other -> :error
    end
  end

  defp armed(nil), do: {:ok, nil}
  defp armed("disarmed"), do: {:ok, :disarmed}
  defp armed("error"), do: {:ok, {:error, :unknown}}
  defp armed(_other), do: :error

  defp text(text, most \\ @words)
  defp text(nil, _most), do: {:ok, nil}
  defp text(text, most) when is_binary(text) and byte_size(text) <= most, do: {:ok, text}
  defp text(_other, _most), do: :error

  defp hangs(nil, _age_ms), do: {:ok, nil}

  defp hangs({what, where, ago_ms}, age_ms)
       when what in ["silent", "hung"] and is_binary(where) and is_integer(ago_ms) and ago_ms >= 0 do
    what = if what == "silent", do: :silent, else: :hung
    {:ok, {what, String.slice(where, 0, @words), ago_ms + age_ms}}
  end

  defp hangs(_other, _age_ms), do: :error

  defp metres(nil), do: {:ok, nil}
  defp metres(mm) when is_integer(mm) and mm in 0..@unsure_mm, do: {:ok, mm / 1000}
  defp metres(_other), do: :error

  defp texts?(list), do: Wire.list?(list, &is_binary/1)

  defp names(texts),
    do: for(text <- texts, {:ok, name} <- [Blackboard.Codec.robot(text)], do: name)

  defp place({x, y, heading}), do: Pose.new(x / 1000, y / 1000, heading / 1000)
end
