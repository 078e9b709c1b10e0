defmodule Robot.Body do
  @moduledoc false
  # One body on a plane for tests: the gate's output moves it, its percepts feed a controller.
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Percept
  alias Robot.Control.Controller
  alias Robot.Safety.Reflex

  def new(pose, profile \\ Profile.magellan()) do
    reflex = Reflex.new(profile)

    %{
      pose: pose,
      twist: Twist.zero(),
      at_ms: 0,
      reflex: reflex,
      controller: Controller.new(profile: profile),
      profile: profile,
      pan: nil
    }
  end

  @doc "The same with a camera on a pan-tilt unit, that looks ahead."
  def with_head(body), do: %{body | pan: 0.0}

  @doc "Runs the controller for some ticks; `change` may change each percept; gives outcome and body."
  def run(body, ticks, change \\ & &1)
  def run(body, 0, _change), do: {nil, body}

  def run(body, ticks, change) do
    {wish, outcome, controller} = Controller.tick(body.controller, change.(percept(body)))
    body = %{body | controller: controller} |> act(wish)
    if outcome, do: {outcome, body}, else: run(body, ticks - 1, change)
  end

  def percept(body) do
    %Percept{
      robot: :mag1,
      at_ms: body.at_ms,
      profile: body.profile,
      pose: body.pose,
      odometry: %Odometry{pose: body.pose, twist: body.twist},
      sonar: silence(body.profile),
      driving: %{twist: body.twist, limits: []},
      ptz: body.pan && %{pan: body.pan, tilt: 0.0, field_of_view: :math.pi() / 3}
    }
  end

  def silence(profile), do: List.duplicate(profile.sonar_max, length(profile.sonars))

  defp act(body, wish) do
    reflex =
      body.reflex
      |> Reflex.wish(wish.twist, body.at_ms)
      |> Reflex.sense({:sonar, silence(body.profile)}, body.at_ms)
      |> elem(0)

    Enum.reduce(1..2, %{body | reflex: reflex}, fn _, body ->
      {twist, _limits, reflex} = Reflex.step(body.reflex, body.at_ms)
      pose = move(body.pose, twist, 0.05)
      pan = slew(body.pan, wish.look, body.profile.camera.pan_rate * 0.05)
      %{body | reflex: reflex, twist: twist, pose: pose, pan: pan, at_ms: body.at_ms + 50}
    end)
  end

  defp slew(pan, look, _most) when pan == nil or look == nil, do: pan
  defp slew(pan, look, most), do: pan + max(-most, min(most, look - pan))

  @doc "The pose after driving so for some seconds."
  def move(pose, twist, seconds) do
    middle = pose.heading + twist.turn * seconds / 2
    x = pose.x + twist.linear * seconds * :math.cos(middle)
    y = pose.y + twist.linear * seconds * :math.sin(middle)
    Pose.new(x, y, pose.heading + twist.turn * seconds)
  end

  @doc "A blob as the camera of this body shows it, of a thing at this place; nil outside the picture."
  def blob(body, {x, y}, colour \\ "Yellow") do
    bearing = Pose.bearing(body.pose, {x, y})
    distance = Pose.distance(body.pose, {x, y})
    focal = 160 / :math.tan(:math.pi() / 6)

    if abs(bearing) < :math.pi() / 6 do
      share = min(0.5, 0.0651 / (distance * distance))
      cx = 159.5 - focal * :math.tan(bearing)
      at = round(cx)

      %Vision.Blob{
        colour: colour,
        area: round(share * 76_800),
        share: share,
        x: cx,
        y: 120.0,
        left: at,
        right: at,
        top: 110,
        bottom: 130,
        width: 320,
        height: 240,
        distance: distance
      }
    end
  end

  @doc "A percept changer that shows a thing at this place."
  def see(percept, place, wobble \\ 0.0) do
    eye = %{percept.pose | heading: percept.pose.heading + pan(percept)}
    blob = blob(%{pose: eye}, place)
    show(percept, if(blob, do: [%{blob | x: blob.x + wobble}], else: []))
  end

  @doc "A percept changer that shows nothing."
  def see_nothing(percept), do: show(percept, [])

  defp show(percept, blobs) do
    picture = %Vision.Detections{
      at_ms: percept.at_ms,
      blobs: blobs,
      pan: pan(percept),
      pose: percept.pose
    }

    %{percept | detections: picture}
  end

  defp pan(%{ptz: nil}), do: 0.0
  defp pan(%{ptz: %{pan: pan}}), do: pan
end
