defmodule Console.Picture.Film do
  @moduledoc """
  Draws a run as an animation: an SVG that moves by itself where it is shown, in a README for instance. The floor with the
  robots, what has happened so far beside it, and below it the formation error. Pure; it has no script, needs no font and no other file.

  Places between two scenes are interpolated, and a film goes round for ever. It lasts some 10 to 30 s, however long the run was.
  """
  alias Console.Cli.Format
  alias Console.Picture.{Floor, Floorplan, Plot, RunTrack, Svg, Walls}
  alias Hal.Pose

  @width 980
  @margin 20
  @top 52
  @floor_height 460
  @beside 300
  @plot_height 130
  @ink "#22262B"
  @dim "#6A717B"
  # A run of a minute is seen in 12 s.
  @times 5
  @shortest_s 8
  @longest_s 30
  @told 12
  @letters 46

  @doc """
  The animation of scenes that are equally far apart in time, oldest first, with a title. Needs two of them, and a map; the error
  is one line.
  """
  @spec draw([Sim.Scene.t()], String.t()) :: {:ok, iodata()} | {:error, line :: String.t()}
  def draw([%{map: nil} | _], _title),
    do: {:error, "only a run in lockstep can be drawn: robots of processes know no map"}

  def draw([first, _second | _] = scenes, title) do
    track = Enum.reduce(tl(scenes), RunTrack.new(first), &RunTrack.add(&2, &1))
    {:ok, drawing(track, scenes, title)}
  end

  def draw(_one, _title), do: {:error, "a film needs a second of a run at least"}

  defp drawing(track, scenes, title) do
    ground = Floorplan.of(track.first.map)
    {left, bottom, right, top} = box = Floor.box(ground, track)
    floor_width = @width - 3 * @margin - @beside
    scale = min(floor_width / (right - left), @floor_height / (top - bottom))
    height = (top - bottom) * scale
    last_s = track.last.at_ms / 1000
    seconds = (last_s / @times) |> max(@shortest_s) |> min(@longest_s) |> round()

    film = %{
      scenes: scenes,
      at: &at(&1, box, scale),
      scale: scale,
      from_s: track.first.at_ms / 1000,
      last_s: last_s,
      dur: "#{seconds}s"
    }

    plot? = track.errors != []
    plot_y = @top + height + 34
    total = if plot?, do: round(plot_y + @plot_height + 48), else: round(@top + height + @margin)

    Svg.document(@width, total, [
      Svg.text(title, @margin, 32, font_size: 17, font_weight: "bold", fill: @ink),
      Svg.group(
        [transform: "translate(#{@margin} #{@top})"],
        floor(ground, track, film, box)
      ),
      Svg.group(
        [transform: "translate(#{@width - @margin - @beside} #{@top})"],
        happened(track, film)
      ),
      if(plot?, do: plot(track, film, plot_y), else: [])
    ])
  end

  defp at({x, y}, {left, _bottom, _right, top}, scale),
    do: {(x - left) * scale, (top - y) * scale}

  defp floor(ground, track, film, {left, bottom, right, top} = box) do
    {width, height} = {(right - left) * film.scale, (top - bottom) * film.scale}
    colours = Floor.colours(track)

    [
      Svg.element(:clipPath, [id: "film"], Svg.element(:rect, width: width, height: height)),
      Svg.element(:rect, width: width, height: height, fill: "#FBFBF9"),
      Svg.group([clip_path: "url(#film)"], [
        Walls.draw(ground, box, film.scale),
        Enum.map(track.first.robots, &way(&1, track, colours, film)),
        landmark(film),
        Enum.map(track.first.robots, &robot(&1.id, elem(colours[&1.id], 0), film))
      ]),
      Svg.element(:rect, width: width, height: height, fill: "none", stroke: Walls.wall())
    ]
  end

  defp way(robot, track, colours, film) do
    Svg.element(:polyline,
      points: track.ways[robot.id] |> Enum.map(film.at) |> Svg.points(),
      fill: "none",
      stroke: elem(colours[robot.id], 0),
      stroke_width: 1.5,
      stroke_opacity: 0.25
    )
  end

  defp landmark(film) do
    case Enum.map(film.scenes, & &1.landmark) do
      [nil | _] ->
        []

      places ->
        Svg.group([], [
          moves(Enum.map(places, film.at), film),
          Floor.diamond(0.0, 0.0, max(0.25 * film.scale, 7.0))
        ])
    end
  end

  # Its body turns, its name does not.
  defp robot(id, colour, film) do
    seen = for scene <- film.scenes, robot <- scene.robots, robot.id == id, do: robot
    middle = fn _point -> {0.0, 0.0} end
    still = %{hd(seen) | pose: Pose.new(0, 0)}
    r = Console.Picture.Colours.size(still, film.scale)

    crown =
      Svg.element(
        :circle,
        [r: r + 4, fill: "none", stroke: @ink, stroke_width: 2],
        steps("visibility", Enum.map(seen, &if(&1.leader?, do: "visible", else: "hidden")), film)
      )

    Svg.group([], [
      moves(Enum.map(seen, &film.at.(Pose.point(&1.pose))), film),
      steps("opacity", Enum.map(seen, &if(&1.alive, do: "1", else: "0.3")), film),
      crown,
      Svg.group([], [
        turns(Enum.map(seen, & &1.pose.heading), film),
        Floor.body(still, middle, film.scale, fill: colour, stroke: "#FFFFFF", stroke_width: 1.2)
      ]),
      Svg.text("#{id}", 0, -r - 6,
        font_size: 11,
        text_anchor: "middle",
        fill: @ink,
        paint_order: "stroke",
        stroke: "#FFFFFF",
        stroke_width: 3
      )
    ])
  end

  defp moves(places, film) do
    values = Enum.map_join(places, ";", fn place -> Svg.points([place]) end)
    transform("translate", values, film)
  end

  # Of two ways round it takes the shorter one; SVG's angles grow to the right.
  defp turns([first | _] = headings, film) do
    {degrees, _last} =
      Enum.map_reduce(headings, first, fn heading, before ->
        heading = before + Pose.wrap(heading - before)
        {Format.decimals(-heading * 180 / :math.pi(), 0), heading}
      end)

    transform("rotate", Enum.join(degrees, ";"), film)
  end

  defp transform(type, values, film) do
    Svg.element(:animateTransform,
      attributeName: "transform",
      type: type,
      values: values,
      dur: film.dur,
      repeatCount: "indefinite"
    )
  end

  # What jumps from one value to the next.
  defp steps(attribute, values, film) do
    case Enum.dedup(values) do
      [only] -> Svg.element(:set, attributeName: attribute, to: only)
      _several -> discrete(attribute, changes(values), film)
    end
  end

  defp changes(values) do
    count = length(values)

    values
    |> Enum.with_index()
    |> Enum.dedup_by(&elem(&1, 0))
    |> Enum.map(fn {value, index} -> {value, index / count} end)
  end

  defp discrete(attribute, changes, film) do
    Svg.element(:animate,
      attributeName: attribute,
      calcMode: "discrete",
      values: Enum.map_join(changes, ";", &elem(&1, 0)),
      keyTimes: Enum.map_join(changes, ";", &Format.decimals(elem(&1, 1), 4)),
      dur: film.dur,
      repeatCount: "indefinite"
    )
  end

  # The newest of what happened, each from when it did.
  defp happened(track, film) do
    stages = track.last.stages |> Enum.take(-@told)

    [
      Svg.text("What happened", 0, 12, font_size: 13, font_weight: "bold", fill: @ink)
      | for {stage, row} <- Enum.with_index(stages) do
          share = (stage.at_s - film.from_s) / (film.last_s - film.from_s)

          from =
            if share > 0.0,
              do: [{"hidden", 0.0}, {"visible", min(share, 0.999)}],
              else: [{"visible", 0.0}]

          y = 36 + 34 * row
          {first, second} = folded(Format.meaning(stage))

          Svg.group([], [
            discrete("visibility", from, film),
            Svg.text(Format.decimals(stage.at_s, 1) <> " s", 44, y,
              font_size: 11,
              text_anchor: "end",
              fill: @dim
            ),
            Svg.text(first, 52, y, font_size: 11, fill: @ink),
            Svg.text(second, 52, y + 13, font_size: 11, fill: @ink)
          ])
        end
    ]
  end

  # In two lines, cut where it is longer.
  defp folded(text) do
    {first, rest} = text |> String.split(" ") |> Enum.split(fitting(String.split(text, " ")))
    second = Enum.join(rest, " ")

    cut =
      if String.length(second) > @letters,
        do: String.slice(second, 0, @letters - 1) <> "…",
        else: second

    {Enum.join(first, " "), cut}
  end

  defp fitting(words) do
    words
    |> Enum.scan(0, fn word, length -> length + String.length(word) + 1 end)
    |> Enum.count(&(&1 <= @letters))
  end

  defp plot(track, film, y) do
    {x, width} = {@margin + 52, @width - 2 * @margin - 60}

    Svg.group([transform: "translate(#{x} #{round(y)})"], [
      Plot.draw(track, width * 1.0, @plot_height * 1.0),
      Svg.element(
        :line,
        [x1: 0, x2: 0, y1: 0, y2: @plot_height, stroke: @ink, stroke_width: 2],
        Svg.element(:animateTransform,
          attributeName: "transform",
          type: "translate",
          values: "0,0;#{width},0",
          dur: film.dur,
          repeatCount: "indefinite"
        )
      )
    ])
  end
end
