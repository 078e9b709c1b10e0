defmodule Robot.Control.Inbox do
  @moduledoc """
  Decides whether what arrives at the executive or the pilot is whole, so that one can calculate with it. Any process of a node
  may send them anything; what only looks like a message of theirs ends neither (`docs/security.md`). Pure.

  Numbers count up to 1.0e9 either way, which no robot measures: there are integers too large to be made a float.
  """
  alias Hal.{HardenedServer, Odometry, Pose, Profile, Twist}
  alias Robot.Percept
  alias Robot.Control.Delivery
  alias Robot.Localiser.Anchors
  alias Vision.{Blob, Detections}

  @most 1.0e9
  @blob_numbers [:area, :share, :x, :y, :left, :top, :right, :bottom, :width, :height]

  defguardp is_measure(x) when is_number(x) and x > -@most and x < @most
  defguardp is_point(at) when is_measure(elem(at, 0)) and is_measure(elem(at, 1))

  defguardp is_triple(t)
            when tuple_size(t) == 3 and is_measure(elem(t, 0)) and is_measure(elem(t, 1)) and
                   is_measure(elem(t, 2))

  @doc """
  Whether a term is an order of a mission (`t:Robot.Mission.order/0`) whose goal a behaviour accepts.

      iex> alias Robot.Control.Inbox
      iex> for order <- [{:goal, 1, nil}, {:look, 0.5}, {:anchors, %Robot.Localiser.Anchors{}}], do: Inbox.order?(order)
      [true, true, true]
      iex> for order <- [{:goal, 1, {:nomodule, []}}, {:look, :left}, {:anchors, %Robot.Localiser.Anchors{marks: [1 | 2]}}],
      ...>     do: Inbox.order?(order)
      [false, false, false]
  """
  @spec order?(term()) :: boolean()
  def order?({:goal, _tag, goal}), do: Robot.Behaviour.check(goal) == :ok
  def order?({:look, pan}), do: pan == nil or is_measure(pan)

  def order?({:anchors, %{__struct__: Anchors, frame: frame, marks: marks} = anchors}),
    do: frame?(frame) and all?(marks, &mark?/1) and rest?(anchors)

  def order?(_other), do: false

  defp rest?(%{standing: standing, walls?: walls?}),
    do: (standing == nil or is_binary(standing)) and is_boolean(walls?)

  defp rest?(_anchors), do: false

  defp frame?(nil), do: true

  defp frame?(%{
         key: _,
         base: _,
         at: at,
         position: position,
         heading: heading,
         start: start,
         drift: drift,
         slip: slip
       })
       when is_point(at) and tuple_size(at) == 2 and is_measure(position) and
              is_measure(heading) and is_point(start) and is_triple(drift) and is_measure(slip),
       do: true

  defp frame?(_other), do: false

  defp mark?(%{
         key: _,
         kind: kind,
         colour: colour,
         at: at,
         sd: sd,
         common: common,
         reference?: reference?,
         radius: radius
       })
       when kind in [:landmark, :robot] and is_binary(colour) and is_point(at) and
              tuple_size(at) == 2 and is_triple(sd) and is_point(common) and
              is_boolean(reference?) and is_measure(radius),
       do: true

  defp mark?(_other), do: false

  @doc """
  Whether a term is a percept with all that `t:Robot.Percept.t/0` promises; of its heartbeats only that they are structs.

      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan()}
      iex> for percept <- [percept, %{percept | pose: {0, 0}}, %{percept | sonar: [1.0 | 2]}, Map.delete(percept, :peers)],
      ...>     do: Robot.Control.Inbox.percept?(percept)
      [true, false, false, false]
  """
  @spec percept?(term()) :: boolean()
  def percept?(%{
        __struct__: Percept,
        robot: robot,
        at_ms: at_ms,
        profile: profile,
        pose: pose,
        uncertainty: uncertainty,
        odometry: odometry,
        sonar: sonar,
        ir: ir,
        bumpers: bumpers,
        power: power,
        ptz: ptz,
        detections: detections,
        objects: objects,
        peers: peers,
        driving: driving,
        grid: nil
      })
      when is_atom(robot) and is_integer(at_ms) and is_map(peers) and
             (power == nil or is_measure(power)),
      do:
        keys?(profile, Profile) and (pose == nil or pose?(pose)) and uncertainty?(uncertainty) and
          odometry?(odometry) and ranges?(sonar) and ranges?(ir) and
          all?(bumpers, &is_integer/1) and ptz?(ptz) and detections?(detections) and
          objects?(objects) and driving?(driving) and all?(Map.values(peers), &peer?/1)

  def percept?(_other), do: false

  defp pose?(%{__struct__: Pose, x: x, y: y, heading: heading})
       when is_measure(x) and is_measure(y) and is_measure(heading),
       do: true

  defp pose?(_other), do: false

  defp twist?(%{__struct__: Twist, linear: linear, turn: turn})
       when is_measure(linear) and is_measure(turn),
       do: true

  defp twist?(_other), do: false

  defp uncertainty?(nil), do: true

  defp uncertainty?(%{
         radius: radius,
         lost?: lost?,
         position: position,
         spread: spread,
         heading: heading,
         frame: _,
         frame_no: frame_no,
         start: start,
         drift: drift,
         slip: slip
       })
       when is_measure(radius) and is_boolean(lost?) and is_measure(position) and
              is_triple(spread) and is_measure(heading) and is_integer(frame_no) and
              is_point(start) and is_triple(drift) and is_measure(slip),
       do: true

  defp uncertainty?(_other), do: false

  defp odometry?(nil), do: true

  defp odometry?(%{__struct__: Odometry, pose: pose, twist: twist, frame: _}),
    do: pose?(pose) and twist?(twist)

  defp odometry?(_other), do: false

  defp ranges?(ranges), do: ranges == nil or all?(ranges, &is_measure/1)

  defp ptz?(nil), do: true

  defp ptz?(%{pan: pan, tilt: tilt, field_of_view: field})
       when is_measure(pan) and is_measure(tilt) and (field == nil or is_measure(field)),
       do: true

  defp ptz?(_other), do: false

  defp detections?(nil), do: true

  defp detections?(%{
         __struct__: Detections,
         at_ms: at_ms,
         blobs: blobs,
         pan: pan,
         tilt: tilt,
         field_of_view: field,
         pose: pose
       })
       when is_integer(at_ms) and is_measure(pan) and is_measure(tilt) and
              (field == nil or is_measure(field)),
       do: (pose == nil or pose?(pose)) and all?(blobs, &blob?/1)

  defp detections?(_other), do: false

  defp objects?(nil), do: true
  defp objects?(objects), do: is_map(objects) and all?(Map.to_list(objects), &object?/1)

  defp object?({colour, %{blob: blob, bearing: bearing}}) when is_measure(bearing),
    do: is_binary(colour) and blob?(blob)

  defp object?(_other), do: false

  defp blob?(%{__struct__: Blob, colour: colour, distance: distance, clipped?: clipped?} = blob)
       when is_binary(colour) and (distance == nil or is_measure(distance)) and
              is_boolean(clipped?),
       do: keys?(blob, Blob) and all?(@blob_numbers, &is_measure(Map.fetch!(blob, &1)))

  defp blob?(_other), do: false

  defp driving?(nil), do: true
  defp driving?(%{twist: twist, limits: limits}), do: twist?(twist) and all?(limits, &is_atom/1)
  defp driving?(_other), do: false

  defp peer?(%{pose: pose, twist: twist, radius: radius, at_ms: at_ms, mode: mode} = peer)
       when is_measure(radius) and is_integer(at_ms) and mode in [:moving, :holding, :dead],
       do:
         pose?(pose) and twist?(twist) and is_struct(Map.get(peer, :beat, %Anchors{})) and
           integer_or_nil?(peer[:direct_ms])

  defp peer?(_other), do: false

  @doc "Whether a term is a delivery (`t:Robot.Control.Delivery.t/0`) whose reply can be applied."
  @spec delivery?(term()) :: boolean()
  def delivery?(%{
        __struct__: Delivery,
        ways: ways,
        until_ms: until_ms,
        reply: reply,
        asked: asked
      })
      when is_integer(until_ms),
      do: integer_or_nil?(asked) and all?(ways, &way?/1) and HardenedServer.callable?(reply, 1)

  def delivery?(_other), do: false

  defp way?({:hand, {kind, name}}),
    do: kind in [:only, :except, :taking, :naming] and is_atom(name)

  defp way?({:start, module, _options}), do: is_atom(module)
  defp way?(way), do: way == :resume

  defp integer_or_nil?(number), do: number == nil or is_integer(number)

  defp keys?(%{__struct__: module} = struct, module),
    do: module.__struct__() |> Map.keys() |> Enum.all?(&is_map_key(struct, &1))

  defp keys?(_other, _module), do: false

  # Not `Enum.all?/2`, which raises for an improper list.
  defp all?([first | rest], fits?), do: fits?.(first) and all?(rest, fits?)
  defp all?(rest, _fits?), do: rest == []
end
