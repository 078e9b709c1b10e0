defmodule Console.Report do
  @moduledoc """
  Writes the report of a run: fixed keys in a fixed order, and the summary for people.

  Lengths, angles and times are rounded to three decimals. Two runs from one seed give the same
  bytes, except for `wall_s`, the only key that depends on the machine.
  """
  alias Console.Cli.{Format, OutFile, Output}
  alias Lab.Trial.Claims

  @version Mix.Project.config()[:version]

  @keys ~w(version seed map robots simulated_s wall_s stages leader leaders_at_once_max
           leader_changes formation claims stuck landmark_distance_m collisions min_separation_m messages fleet)a
  @stage ~w(stage at_s robot epoch size_ppm as asked followers says)a
  @formation ~w(kind spacing_m error_mean_m error_max_m share_of_time_formed)a
  @claim ~w(at_s robot worst_m worst_5s_m)a
  @messages ~w(sent lost)a
  @stuck ~w(at_s robot error_m)a
  # So many robots that are not done are named.
  @told 4

  @robot ~w(name alive state blocked_by x y theta slot error_m uncertainty_m size_ppm)a

  @doc """
  The report as a term for `Hal.Json.encode!/1`, from a trial's result.
  """
  @spec term(map(), float()) :: {:object, [{atom(), term()}]}
  def term(result, wall_s) do
    result
    |> Map.merge(%{
      version: @version,
      wall_s: wall_s,
      stages: Enum.map(result.stages, &stage/1),
      formation: object(result.formation, @formation),
      claims: Enum.map(result.claims, &object(&1, @claim)),
      stuck: Enum.map(result.stuck, &object(&1, @stuck)),
      messages: object(result.messages, @messages),
      fleet: Enum.map(result.fleet, &object(&1, @robot))
    })
    |> object(if(result.mission in [nil, "landmark"], do: @keys, else: [:mission | @keys]))
  end

  @doc "The report as JSON: one line with a newline at its end."
  @spec json(map(), float()) :: iodata()
  def json(result, wall_s), do: [Hal.Json.encode!(term(result, wall_s)), "\n"]

  @doc "The end of a run in a few lines for people."
  @spec summary(map(), boolean(), float()) :: [String.t()]
  def summary(result, formed?, wall_s) do
    [
      outcome(result, formed?) <>
        no_room(result.stages, formed?) <>
        wrong(result.claims) <>
        blocked(result.fleet) <>
        unsure(result.fleet) <> if(formed?, do: "", else: under_way(result.fleet)) <> seen(result),
      safety(result),
      leadership(result),
      "#{Format.decimals(result.simulated_s, 1)} s simulated in #{Format.decimals(wall_s, 1)} s" <>
        " (#{speed(result.simulated_s / max(wall_s, 0.001))} times real time)"
    ]
  end

  @doc "Whether the files that the options name can be written: known before a run, not after it."
  @spec check(Console.Options.t()) :: :ok | {:error, String.t()}
  def check(options) do
    with :ok <- OutFile.check("--json", options.json),
         :ok <- OutFile.check("--picture", options.picture),
         do: OutFile.check("--save-map", options.save_map)
  end

  @doc """
  Writes the report and the picture to the files that the options name. `drawing` takes no
  argument and is called only if a picture is wanted.
  """
  @spec write(Console.Options.t(), iodata(), (... -> iodata()) | nil, Output.t()) ::
          :ok | {:error, String.t()}
  def write(options, json, drawing, output) do
    with :ok <- put("--json", options.json, fn -> json end, output),
         do: put("--picture", options.picture, drawing, output)
  end

  defp put(_option, nil, _content, _output), do: :ok
  defp put("--json", "-", content, _output), do: IO.write(content.())

  defp put(option, path, content, output) do
    with :ok <- OutFile.write(option, path, content.()), do: Output.line(output, "Wrote #{path}")
  end

  defp stage(stage) do
    keys = Enum.filter(@stage, &(Map.get(stage, &1) != nil))
    object(stage, keys)
  end

  defp object(map, keys), do: {:object, for(key <- keys, do: {key, value(Map.fetch!(map, key))})}

  defp value(float) when is_float(float), do: tidy(Float.round(float, 3))
  defp value({:object, _pairs} = object), do: object
  defp value({x, y}), do: [value(x), value(y)]
  defp value(list) when is_list(list), do: Enum.map(list, &value/1)
  defp value(other), do: other

  # -0.0 and 0.0 are the same number and must be the same text.
  defp tidy(zero) when zero == 0.0, do: 0.0
  defp tidy(float), do: float

  defp outcome(%{leader: nil, mission: mission} = result, formed?)
       when mission not in [nil, "landmark"] do
    living = Enum.filter(result.fleet, & &1.alive)

    if formed?,
      do:
        "#{mission}: #{all(length(living))} reached #{if(length(living) == 1, do: "its", else: "their")} goal.",
      else: "#{mission}: the goal is not reached" <> short(Enum.reject(living, & &1.formed?))
  end

  defp outcome(%{leader: nil} = result, _formed?),
    do:
      "No formation: #{Format.count(result.robots, "robot")}, and none of them leads.#{said(result)}"

  defp outcome(%{formation: formation} = result, true) do
    {placed, others} =
      result.fleet
      |> Enum.filter(& &1.alive)
      |> Enum.split_with(&(&1.slot != nil or &1.name == result.leader))

    "In formation: #{shape(formation, result.stages)} of #{length(placed)} led by #{result.leader}" <>
      error(formation) <> distance(result.landmark_distance_m) <> "." <> apart(others)
  end

  defp outcome(%{formation: formation} = result, false),
    do: "Not in formation: #{formation.kind} led by #{result.leader}#{error(formation)}."

  # Robots that live and have no place in the leader's shape, such as those whose wheels were disarmed.
  defp apart([]), do: ""

  defp apart(robots) do
    {told, others} = Enum.split(robots, @told)
    more = if others == [], do: "", else: " and #{length(others)} more"
    names = Enum.map_join(told, ", ", &"#{&1.name} (#{words(&1.state)})")
    " Not in it: #{names}#{more}."
  end

  defp words(state), do: state |> to_string() |> String.replace("_", " ")

  defp all(1), do: "1 robot has"
  defp all(count), do: "all #{count} robots have"

  # The robots that do not claim `formed`, in the mission's own words.
  defp short([]), do: "."

  defp short(robots) do
    {told, others} = Enum.split(robots, @told)
    more = if others == [], do: "", else: "; and #{length(others)} more"

    ": " <>
      Enum.map_join(told, "; ", &"#{&1.name} is not done (#{&1.says || &1.state})") <> more <> "."
  end

  # What robots that look for a landmark say of that; most of them say the same.
  defp said(%{fleet: fleet}) do
    for [%{says: says} | _] = robots when says != nil <-
          fleet |> Enum.filter(& &1.alive) |> Enum.sort_by(& &1.says) |> Enum.chunk_by(& &1.says),
        into: "",
        do: " #{Enum.map_join(robots, ", ", & &1.name)}: #{says}."
  end

  defp seen(%{seen: %{area_m2: area_m2, share: share, walls: walls}}) do
    " Seen: #{Format.decimals(share * area_m2, 0)} of the #{Format.decimals(area_m2, 0)} m² " <>
      "that a robot can come to (#{Format.decimals(100 * share, 1)} %)." <> walls(walls)
  end

  defp seen(_without_a_map), do: ""

  defp walls(nil), do: ""

  defp walls(share),
    do:
      " Of the walls on the map #{Format.decimals(100 * share, 0)} % are within 0.2 m of true ones."

  # The one that was asked for, unless there was no room for it.
  defp shape(formation, stages) do
    case Enum.find(Enum.reverse(stages), &(&1.stage == :formed)) do
      %{as: :cluster} -> "a cluster"
      %{as: :column} -> "a column along its leader's way"
      %{as: how} -> "#{formation.kind}, #{how},"
      _as_asked -> "#{formation.kind}"
    end
  end

  defp error(%{error_mean_m: nil}), do: ""

  defp error(formation) do
    ", off their places by #{Format.decimals(formation.error_mean_m, 2)} m on average" <>
      " and #{Format.decimals(formation.error_max_m, 2)} m at most"
  end

  # What the leader last said of its shape.
  defp no_room(_stages, true), do: ""

  defp no_room(stages, false) do
    case Enum.find(Enum.reverse(stages), &(&1.stage in [:formed, :cannot_form])) do
      %{stage: :cannot_form} = stage -> " #{String.capitalize(Format.meaning(stage), :ascii)}."
      _formed_or_never_said -> ""
    end
  end

  defp wrong(claims) do
    case Enum.count(claims, &(Claims.right?(&1) == false)) do
      0 -> ""
      count -> " Formed was wrongly claimed " <> times(count, claims) <> "."
    end
  end

  defp times(count, claims) do
    worst =
      claims |> Enum.flat_map(&[&1.worst_m, &1.worst_5s_m]) |> Enum.filter(& &1) |> Enum.max()

    "#{Format.count(count, "time")}: a robot was #{Format.decimals(worst, 2)} m off"
  end

  defp blocked(fleet) do
    case for %{blocked_by: words} = robot when words != nil <- fleet, do: {robot.name, words} do
      [] -> ""
      blocked -> " Blocked: " <> Enum.map_join(blocked, ", ", &by/1) <> "."
    end
  end

  defp by({name, words}), do: "#{name} by #{words}"

  defp unsure(fleet) do
    case for %{state: :unsure} = robot <- fleet,
             do: "#{robot.name} (#{Format.within(robot.uncertainty_m)})" do
      [] -> ""
      [one] -> " Not sure of its place: #{one}."
      several -> " Not sure of their places: #{Enum.join(several, ", ")}."
    end
  end

  # Followers that claim nothing else.
  defp under_way(fleet) do
    case for %{alive: true, state: :follow, name: name} <- fleet, do: name do
      [] -> ""
      robots -> " Still on the way: #{some(robots)}."
    end
  end

  defp some(robots) do
    {told, others} = Enum.split(robots, @told)
    Enum.join(told, ", ") <> if(others == [], do: "", else: " and #{length(others)} more")
  end

  defp speed(times), do: Format.decimals(times, if(times < 10, do: 1, else: 0))

  defp distance(nil), do: ""
  defp distance(metres), do: ", #{Format.decimals(metres, 2)} m from the landmark"

  defp safety(result) do
    collisions = result.collisions |> Format.count("collision") |> String.capitalize()

    case result.min_separation_m do
      nil ->
        "#{collisions}."

      metres ->
        "#{collisions}; no two robots came closer than #{Format.decimals(metres, 2)} m."
    end
  end

  defp leadership(%{leaders_at_once_max: 0} = result), do: messages(result)

  defp leadership(result) do
    changes = result.leader_changes |> Format.count("change") |> String.capitalize()

    "#{changes} of leader, never more than #{result.leaders_at_once_max} at once; " <>
      messages(result)
  end

  defp messages(result),
    do: "#{Format.count(result.messages.sent, "message")}, #{result.messages.lost} lost."
end
