defmodule Robot.File.Summary do
  @moduledoc """
  Summarises a robot file for a person, to be read before the robot moves. Pure, except that
  `report/4` looks for device files and a folder unless told how.
  """
  alias Hal.{Pose, Profile}

  alias Robot.File.{Device, RecordOptions, Warnings}

  @delay_s 0.3
  @wide 88

  @doc """
  The report on a file without errors: a title with the number of warnings (`Robot.File.Warnings`), the
  lines of `lines/1`, and the warnings. `there?` reports whether a device exists on this machine,
  `writable?` whether a recording can be written into a folder.
  """
  @spec report(
          Path.t(),
          Robot.File.t(),
          (Path.t() -> boolean()),
          (Path.t() -> boolean())
        ) :: [String.t(), ...]
  def report(
        path,
        %Robot.File{} = robot,
        there? \\ &File.exists?/1,
        writable? \\ &RecordOptions.writable?/1
      ) do
    odd =
      Warnings.lines(robot, there?, &kind/1) ++
        unwritable(:record, robot.record, writable?) ++
        unwritable(:incidents, robot.incidents, writable?)

    title =
      case length(odd) do
        0 -> "#{path}: valid"
        1 -> "#{path}: valid, 1 warning below"
        n -> "#{path}: valid, #{n} warnings below"
      end

    [title | lines(robot)] ++ Enum.flat_map(odd, &row({:WARNING, &1}))
  end

  # Linux knows of a serial port whether there is hardware, which it has asked, and whether it writes its own words there.
  defp kind(path) do
    case File.stat(path) do
      {:ok, %File.Stat{type: :device}} -> tty(Path.join("/sys/class/tty", Path.basename(path)))
      {:ok, %File.Stat{type: type}} -> type
      {:error, _unknown} -> :device
    end
  end

  defp tty(folder) do
    case {File.read(folder <> "/type"), File.read(folder <> "/console")} do
      {{:ok, "0\n"}, _console} -> :no_hardware
      {_type, {:ok, "Y\n"}} -> :console
      _any_other -> :device
    end
  end

  @doc """
  The robot in lines of at most 100 characters; the first names it.

      iex> robot = %Robot.File{id: :mag1, profile: Hal.Profile.magellan(), start: Hal.Pose.new(0, 0),
      ...>   drive: {Some.Drive, [port: "/dev/ttyS1"]}}
      iex> [first | _] = Robot.File.Summary.lines(robot)
      iex> first
      "mag1, a Magellan Pro of 20 kg: 0.40 m long, 0.40 m wide, 0.20 m to its farthest corner"
  """
  @spec lines(Robot.File.t()) :: [String.t(), ...]
  def lines(%Robot.File{} = robot) do
    profile = struct!(robot.profile, robot.limits)
    body = robot.profile
    judgement = Device.judge(robot.drive, body)

    [
      "#{robot.id}, #{about(body)}: #{metres(body.length)} long, " <>
        "#{metres(body.width)} wide, #{metres(body.radius)} to its farthest corner"
    ] ++
      rows(
        drive: device(robot.drive),
        measured: conversions(robot.drive, judgement),
        moves: moves(profile),
        stops: stops(profile),
        has: senses(body, judgement),
        head: robot.ptz && device(robot.ptz),
        camera: robot.camera && device(robot.camera),
        lidar: robot.scan && device(robot.scan),
        "looks for": colours(robot.colours),
        marks: marks(robot.marks),
        keeps: pictures(robot.save_pictures),
        records: recording(robot.record),
        keeps: incidents(robot.incidents),
        starts: start(robot.start),
        knows: map(robot.map),
        arms: arms(robot),
        stays: fence(robot.fence),
        "e-stop": estop(robot.estop_file),
        presence: presence(robot.presence),
        says: says(robot.say),
        power: power(robot.console),
        network: network(robot.network),
        mission: mission(robot.policies),
        replace: replaceable(robot)
      )
  end

  defp about(%Profile{about: about, name: name, mass: mass}),
    do: (about || "a #{name}") <> if(mass, do: " of #{kilograms(mass)} kg", else: "")

  defp kilograms(mass) when mass >= 10, do: "#{round(mass)}"
  defp kilograms(mass), do: :erlang.float_to_binary(mass * 1.0, decimals: 1)

  defp rows(rows) do
    for {_name, words} = row <- rows, words not in [nil, ""], line <- row(row), do: line
  end

  defp row({name, words}) do
    [first | more] = wrap(words)

    ["  #{String.pad_trailing(to_string(name), 10)}#{first}"] ++
      for(line <- more, do: String.duplicate(" ", 12) <> line)
  end

  # A word that is longer than a line, such as a path, is shortened.
  defp wrap(words) do
    words
    |> String.split(" ")
    |> Enum.map(&short/1)
    |> Enum.reduce([""], fn word, [line | lines] ->
      cond do
        line == "" -> [word | lines]
        String.length(line) + 1 + String.length(word) > @wide -> [word, line | lines]
        true -> [line <> " " <> word | lines]
      end
    end)
    |> Enum.reverse()
  end

  defp short(word),
    do: if(String.length(word) > @wide, do: String.slice(word, 0, @wide - 1) <> "…", else: word)

  defp replaceable(%{replace: false}), do: nil

  defp replaceable(%{replace: true}),
    do: "whoever has the fleet's secret may give it another mission of its release on its way"

  defp pictures(nil), do: nil

  defp pictures(options) do
    {:ok, all} = Vision.Saver.options(options)

    "the newest #{all[:files]} pictures or #{all[:megabytes]} MB in #{all[:folder]}, " <>
      "#{all[:rate]} a second"
  end

  defp recording(nil), do: nil

  defp recording(options) do
    {:ok, all} = RecordOptions.check(options)
    pictures = if all[:pictures], do: ", with #{all[:pictures]} pictures a second", else: ""
    "the newest #{all[:limit_mb]} MB in #{all[:folder]}, for mix replay#{pictures}"
  end

  defp incidents(nil), do: nil

  defp incidents(options) do
    {:ok, all} = RecordOptions.check_incidents(options)

    "the last #{all[:seconds]} s before an incident, the newest #{all[:limit_mb]} MB in #{all[:folder]}"
  end

  defp unwritable(_key, nil, _writable?), do: []

  defp unwritable(key, options, writable?) do
    folder = options[:folder]

    if writable?.(folder),
      do: [],
      else: [
        "#{key}.folder: #{folder} cannot be written on this machine; it must be on the robot's, " <>
          "or the folder that it is in"
      ]
  end

  defp device({module, options}) do
    place = options[:port] || options[:source]
    if place, do: "#{inspect(module)} on #{place}", else: inspect(module)
  end

  # The driver reports why it will not arm: `judge/1` applies the checks of `ready/1`.
  defp conversions(_drive, %{ready: {:error, line}}),
    do: "#{line}: it will not arm (mix calibrate odometry)"

  defp conversions({_module, options}, _judgement) do
    with given when is_list(given) <- options[:conversions],
         true <- given[:distance] != nil and given[:angle] != nil,
         do: "#{number(given[:distance])} units a metre, #{number(given[:angle])} units a radian",
         else: (_nothing -> nil)
  end

  defp moves(profile) do
    "at most #{rate(profile.max_linear, "m/s")} and #{degrees(profile.max_turn)} a second; " <>
      "accelerates at #{rate(profile.max_acceleration, "m/s2")}"
  end

  # v t + v^2 / 2a, where t is the time that a stop may take to reach the wheels.
  defp stops(%Profile{max_linear: v, max_acceleration: a}) do
    way = v * @delay_s + v * v / (2 * a)

    far = if way > 1.0, do: "FAR: ", else: ""

    "#{far}from full speed within #{metres(way)} (#{@delay_s} s until it brakes, then #{rate(a, "m/s2")})"
  end

  defp senses(profile, judgement) do
    "#{sonars(profile)}, #{scan(profile.scan)}#{length(profile.irs)} infrareds#{unread(profile, judgement)}, " <>
      "#{bumpers(profile)}#{blind(profile)}"
  end

  defp sonars(%Profile{sonars: []}), do: "no sonars"

  defp sonars(%Profile{sonars: sonars, sonar_min: least, sonar_max: most}),
    do: "#{length(sonars)} sonars (#{metres(least)} to #{metres(most)})"

  defp scan(nil), do: ""

  defp scan(scan) do
    "a lidar of #{scan.rays} rays within #{degrees(scan.field_of_view)} (#{metres(scan.min)} to #{metres(scan.max)}), "
  end

  defp bumpers(%Profile{bumpers: count, bumper_span: span}) when count > 0 and span < 6.28,
    do: "#{count} bumpers round it, those within #{degrees(span)} ahead"

  defp bumpers(%Profile{bumpers: count}), do: "#{count} bumpers"

  defp unread(%{irs: [_ | _]}, %{senses: senses}),
    do: if(:infrared in senses, do: "", else: " (not read: no ir_a, no ir_b)")

  defp unread(_profile, _judgement), do: ""

  # The widest angle that no sonar covers.
  defp blind(%Profile{sonars: []}), do: ""

  defp blind(%Profile{sonars: sonars, sonar_cone: cone}) do
    angles = sonars |> Enum.map(& &1.heading) |> Enum.sort()
    next = tl(angles) ++ [hd(angles) + 2 * :math.pi()]
    gap = angles |> Enum.zip(next) |> Enum.map(fn {a, b} -> b - a end) |> Enum.max()
    if gap > cone + 0.02, do: "; #{degrees(gap - cone)} without sonar at a stretch", else: ""
  end

  defp colours(nil), do: nil

  defp colours(%{classes: classes}) do
    Enum.map_join(classes, ", ", fn class ->
      if class.distance, do: "#{class.name} (with distance)", else: class.name
    end)
  end

  defp marks(nil), do: nil

  defp marks(given) do
    {known, given} = Keyword.pop(given, :known, [])
    {:ok, marks} = Vision.Marks.new(Keyword.delete(given, :robots))
    places = if known != [], do: "; it knows where #{length(known)} hang"
    "#{marks.family}, #{metres(marks.size)} between their corners#{places}"
  end

  defp start(%Pose{x: x, y: y, heading: heading}),
    do: "at x #{metres(x)}, y #{metres(y)}, heading #{degrees(heading)}"

  defp map(nil), do: nil

  defp map(%{file: file, grid: grid}) do
    [right, high] = [grid.left + grid.width * grid.cell, grid.low + grid.height * grid.cell]

    "the walls of #{file}: x from #{metres(grid.left)} to #{metres(right)}, y from #{metres(grid.low)} to #{metres(high)}"
  end

  defp arms(%{dry_run: true}), do: "never: a dry run, which prints what it would do"
  defp arms(%{arm: :manual}), do: "by hand: its wheels stand until a person arms them"
  defp arms(%{arm: :auto}), do: "BY ITSELF, as soon as it runs"

  defp fence(nil), do: nil

  defp fence(%{corners: corners}) do
    {xs, ys} = Enum.unzip(corners)
    [left, right] = for x <- [Enum.min(xs), Enum.max(xs)], do: metres(x)
    [low, high] = for y <- [Enum.min(ys), Enum.max(ys)], do: metres(y)
    "within #{length(corners)} corners, x from #{left} to #{right}, y from #{low} to #{high}"
  end

  defp says(nil), do: nil

  defp says(options),
    do: "#{Enum.join(options[:events], ", ")}, aloud, by #{options[:program] || "espeak-ng"}"

  defp presence(nil), do: nil

  defp presence(seconds),
    do:
      "moves only while a page, a pad or bin/presence is heard; stops, and is held, #{seconds} s after the last word"

  defp estop(nil), do: "forgotten when the machine restarts (no estop_file)"
  defp estop(file), do: "kept in #{file}"

  defp power(nil), do: nil
  defp power(console), do: "cut by the controller when `robot halt` says so on #{console[:port]}"

  defp network([]), do: nil

  defp network(options) do
    Enum.map_join(options, ", ", fn
      {:interface, card} when is_binary(card) -> "on #{card}"
      {:interface, ip} -> "on #{:inet.ntoa(ip)}"
      {:multicast, false} -> "no multicast"
      {:multicast, {ip, port}} -> "multicast #{:inet.ntoa(ip)}:#{port}"
      {:fleet, names} -> "fleet of #{Enum.join(names, ", ")}"
      {key, values} when is_list(values) -> "#{key}: #{length(values)}"
      {key, value} when is_binary(value) -> "#{key} #{value}"
      {key, value} -> "#{key} #{inspect(value)}"
    end)
  end

  defp mission(policies) do
    case policies[:mission] do
      nil ->
        "none until it is told one"

      {name, own} ->
        Enum.join([named(name) | Enum.map(own, &one/1)], ", ")

      mission ->
        "#{named(mission)}#{formation(policies[:formation])}#{lost(policies[:lost_link])}"
    end
  end

  defp named(name), do: name |> inspect() |> String.trim_leading(":")
  defp one({key, value}), do: "#{key} #{inspect(value)}"

  # Other missions may use these names for options of another shape.
  defp formation({kind, spacing}) when is_atom(kind) and is_number(spacing),
    do: ", in #{kind} of #{metres(spacing)}"

  defp formation(_other), do: ""

  defp lost(policy) when is_atom(policy) and policy != nil, do: ", without link: #{policy}"
  defp lost(_other), do: ""

  defp metres(length), do: "#{:erlang.float_to_binary(length * 1.0, decimals: 2)} m"
  defp rate(value, unit), do: "#{:erlang.float_to_binary(value * 1.0, decimals: 2)} #{unit}"
  defp degrees(angle), do: "#{round(angle * 180 / :math.pi())}°"

  defp number(value) when is_integer(value), do: Integer.to_string(value)
  defp number(value) when trunc(value) == value, do: Integer.to_string(trunc(value))
  defp number(value), do: to_string(Float.round(value * 1.0, 3))
end
