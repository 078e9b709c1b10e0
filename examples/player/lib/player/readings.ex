defmodule Player.Readings do
  @moduledoc """
  Says what a robot's devices measure as Player's messages, ten times a second. Pure. Each is whole but for the first 8 bytes of
  its header (`Player.Wire.encode/5`), so it is written once for all clients.

  Poses are the robot's own estimate in the map of its fleet. It stalls (`stall` of `position2d`) while the emergency stop holds it, or
  a fault makes it stand.
  """
  @behaviour Bridge.Catalogue
  alias Bridge.Catalogue
  alias Player.Wire
  alias Vision.Blob

  @every_ms 100
  @power_ms 1_000

  @devices [
    position2d: 0,
    power: 0,
    localize: 0,
    sonar: 0,
    ranger: 0,
    ir: 0,
    ranger: 1,
    bumper: 0,
    laser: 0,
    ranger: 2,
    ptz: 0,
    blobfinder: 0,
    fiducial: 0
  ]

  # Of a two-dimensional normal distribution 95 of 100 are so many standard deviations from the middle: sqrt(-2 ln 0.05).
  @sd_95 :math.sqrt(-2 * :math.log(0.05))

  # A blob has the name of its colour only.
  @colours [
    {"red", 0xFF0000},
    {"green", 0x00FF00},
    {"blue", 0x0000FF},
    {"yellow", 0xFFFF00},
    {"orange", 0xFF8000},
    {"pink", 0xFF80C0},
    {"white", 0xFFFFFF},
    {"black", 0x000000}
  ]

  @impl Catalogue
  def list(robots) do
    for robot <- robots, {interface, index} = device <- @devices do
      pace = if interface == :power, do: @power_ms, else: @every_ms
      %{key: {robot, device}, name: "#{robot} #{interface}:#{index}", schema: nil, pace: pace}
    end
  end

  @impl Catalogue
  def asks({robot, _device}), do: robot

  @impl Catalogue
  def about({_robot, device}, ns, about) do
    with %{} = values <- values(device, about),
         do: Wire.encode(device, :data, 1, values, ns / 1.0e9)
  end

  # Nothing is said of the fleet, and there is no log.
  @impl Catalogue
  def scene(_key, _ns, _scene, _paths), do: nil

  @impl Catalogue
  def log, do: []

  @impl Catalogue
  def stage(_key, _ns, _stage), do: nil

  @impl Catalogue
  def order(_key, _ns, _asker, _line, _answer), do: nil

  @doc "What a device has measured, as the values of its message (`Player.Wire`); `nil` if that is not known now."
  @spec values(Wire.device(), map()) :: map() | nil
  def values({:position2d, 0}, %{pose: [x, y]} = about) do
    %{
      pose: {x * 1.0, y * 1.0, (about.heading || 0.0) * 1.0},
      speed: {(about.speed || 0.0) * 1.0, 0.0, (about.turn || 0.0) * 1.0},
      stall: if(about.estop || about.fault, do: 1, else: 0)
    }
  end

  def values({:power, 0}, %{power: volts}) when volts != nil,
    do: %{valid: 1, volts: volts * 1.0, percent: 0.0, joules: 0.0, watts: 0.0, charging: 0}

  def values({:localize, 0}, %{pose: [x, y]} = about) do
    # Of a robot elsewhere nothing is known of how sure it is.
    {place, heading} =
      case about.readings do
        %{uncertainty: %{radius: radius, heading: heading}} -> {radius / @sd_95, heading}
        _elsewhere -> {0.0, 0.0}
      end

    mean = {x * 1.0, y * 1.0, (about.heading || 0.0) * 1.0}
    # Variances of x, y and yaw, and the three covariances.
    covariance = {place * place, place * place, heading * heading * 1.0, 0.0, 0.0, 0.0}
    hypothesis = %{mean: mean, covariance: covariance, alpha: 1.0}
    %{pending: 0, pending_time: 0.0, hypotheses: [hypothesis]}
  end

  def values({which, 0}, about) when which in [:sonar, :ranger] do
    case {about.readings, about.sonar} do
      {%{sonar: ranges}, _sonar} -> %{ranges: floats(ranges)}
      {readings, [_ | _] = beams} when readings == %{} -> %{ranges: floats(ends(beams))}
      _none -> nil
    end
  end

  # Volts are not known, only what they mean.
  def values({:ir, 0}, %{readings: %{ir: ranges}}),
    do: %{voltages: Enum.map(ranges, fn _range -> 0.0 end), ranges: floats(ranges)}

  def values({:ranger, 1}, %{readings: %{ir: ranges}}), do: %{ranges: floats(ranges)}

  def values({:bumper, 0}, %{readings: %{bumpers: pressed}, profile: %{bumpers: count}}),
    do: %{
      bumpers: for(k <- 0..(count - 1), into: "", do: if(k in pressed, do: <<1>>, else: <<0>>))
    }

  def values({:laser, 0}, %{readings: %{scan: scan}, profile: %{scan: %{max: most}}}) do
    {least, step, ranges} = rays(scan, most)

    %{
      min_angle: least,
      max_angle: least + max(length(ranges) - 1, 0) * step,
      resolution: step,
      max_range: most * 1.0,
      ranges: ranges,
      intensity: "",
      id: 0
    }
  end

  def values({:ranger, 2}, %{readings: %{scan: scan}, profile: %{scan: %{max: most}}}) do
    {_least, _step, ranges} = rays(scan, most)
    %{ranges: ranges}
  end

  def values({:ptz, 0}, %{readings: %{ptz: ptz}}) do
    %{
      pan: ptz.pan,
      tilt: ptz.tilt,
      zoom: ptz.field_of_view,
      pan_speed: 0.0,
      tilt_speed: 0.0,
      status: 0
    }
  end

  def values({:blobfinder, 0}, %{readings: %{detections: %{blobs: blobs}}} = about) do
    # All blobs of a picture know its size; without one it is that of the body's camera.
    picture = List.first(blobs) || about.profile.camera
    %{width: picture.width, height: picture.height, blobs: Enum.map(blobs, &blob/1)}
  end

  def values({:fiducial, 0}, %{readings: %{detections: %{marks: marks}}}) do
    %{marks: for(%{range: range} = mark when range != nil <- marks || [], do: mark(mark))}
  end

  def values(_device, _about), do: nil

  # A sonar without an echo has its greatest range already; one without a report says nothing.
  defp floats(ranges), do: Enum.map(ranges, &((&1 || 0.0) * 1.0))
  defp ends(beams), do: for([_x, _y, _heading, range] <- beams, do: range)

  # From the right to the left of what it sees, whichever ray a driver names first; a whole turn begins behind. A ray that was
  # not answered saw nothing as far as it reaches; one that was not measured is 0, which no lidar measures.
  defp rays(%{start: start, step: step, ranges: bytes}, most) do
    ranges =
      for <<mm::16 <- bytes>>,
        do: if(mm == Hal.Scan.silent(), do: most * 1.0, else: mm / 1_000)

    count = length(ranges)

    {start, step, ranges} =
      if step < 0,
        do: {start + step * (count - 1), -step, Enum.reverse(ranges)},
        else: {start, step, ranges}

    if abs(count * step - 2 * :math.pi()) < step / 2 do
      turned = Integer.mod(round((-:math.pi() - start) / step), count)
      {before, ahead} = Enum.split(ranges, turned)
      turns = floor((start + turned * step + :math.pi() + step / 2) / (2 * :math.pi()))
      {start + turned * step - turns * 2 * :math.pi(), step, ahead ++ before}
    else
      {start, step, ranges}
    end
  end

  defp blob(%Blob{} = blob) do
    {id, colour} = colour(String.downcase(blob.colour))

    %{
      id: id,
      color: colour,
      area: blob.area,
      x: round(blob.x),
      y: round(blob.y),
      left: blob.left,
      right: blob.right,
      top: blob.top,
      bottom: blob.bottom,
      range: (blob.distance || 0.0) * 1.0
    }
  end

  defp colour(name) do
    @colours
    |> Enum.with_index()
    |> Enum.find_value({length(@colours), 0xFFFFFF}, fn {{word, rgb}, id} ->
      if String.contains?(name, word), do: {id, rgb}
    end)
  end

  defp mark(mark) do
    {x, y} = {mark.range * :math.cos(mark.bearing), mark.range * :math.sin(mark.bearing)}
    yaw = mark.yaw || 0.0
    {range_sd, yaw_sd} = {(mark.range_sd || 0.0) * 1.0, (mark.yaw_sd || 0.0) * 1.0}
    across = mark.range * (mark.bearing_sd || 0.0)

    %{
      id: mark.id,
      pose: {x, y, 0.0, 0.0, 0.0, yaw * 1.0},
      sd: {range_sd, across, 0.0, 0.0, 0.0, yaw_sd}
    }
  end
end
