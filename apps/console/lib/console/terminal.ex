defmodule Console.Terminal do
  @moduledoc """
  Draws the full-screen view of a fleet as a function of a scene and a screen size: returns the text to write. Pure.

  From the top: the state of the fleet, the map beside the table of robots, the last stages,
  answers to commands, three things to try, the prompt.
  """
  alias Console.Cli.Format
  alias Console.Picture.Floorplan
  alias Console.Terminal.{Canvas, Editor, Style, Table}
  alias Sim.Scene

  # What is worth a try in the landmark mission, and in others.
  @try ["kill leader", "formation wedge 1.2", "landmark 3,2", "help", "quit"]
  @try_others ["status", "stop", "start", "help", "quit"]

  defstruct columns: 80,
            rows: 24,
            editor: %Editor{},
            messages: [],
            overlay: nil,
            turned: 0,
            page: {0, 0},
            floor: nil,
            pace: nil,
            driving: nil

  @typedoc """
  What the view keeps besides the scene; `messages` are answers, the newest first; `overlay` are lines in place of the map,
  of which so many rows were `turned`, and `page` is what of the others is shown, and left; `pace` is how fast the run goes;
  `driving` stands in place of the prompt while keys drive a robot.
  """
  @type t :: %__MODULE__{
          columns: pos_integer(),
          rows: pos_integer(),
          editor: Editor.t(),
          messages: [{String.t(), atom()}],
          overlay: [String.t()] | nil,
          turned: non_neg_integer(),
          page: {shown :: non_neg_integer(), left :: non_neg_integer()},
          floor: Canvas.floor() | nil,
          pace: String.t() | nil,
          driving: String.t() | nil
        }

  @doc "The escape sequence that switches the terminal to a screen of our own."
  @spec enter() :: String.t()
  def enter, do: "\e[?1049h\e[?7l\e[2J"

  @doc "The escape sequence that restores the terminal."
  @spec leave() :: String.t()
  def leave, do: "\e[0m\e[?7h\e[?25h\e[?1049l"

  @doc """
  Three things to try, with this mission.

      iex> Console.Terminal.hint("patrol")
      "Try:  status  ·  stop  ·  start  ·  help  ·  quit"
  """
  @spec hint(mission :: String.t() | nil) :: String.t()
  def hint(mission) when mission in [nil, "landmark"], do: "Try:  " <> Enum.join(@try, "  ·  ")
  def hint(_other), do: "Try:  " <> Enum.join(@try_others, "  ·  ")

  @doc "Shows lines in place of the map."
  @spec show(t(), [String.t()]) :: t()
  def show(view, lines), do: %{view | overlay: lines, turned: 0}

  @doc "Turns to the next page of these lines, or back to the map after the last."
  @spec turn(t()) :: t()
  def turn(%{page: {shown, left}} = view) when left > 0, do: %{view | turned: view.turned + shown}
  def turn(view), do: %{view | overlay: nil, turned: 0}

  @doc "The whole screen, and the next state of the view."
  @spec frame(Scene.t(), t()) :: {iodata(), t()}
  def frame(%Scene{} = scene, %__MODULE__{} = view) do
    {rows, view} = rows(scene, view)

    text =
      rows
      |> Enum.with_index(1)
      |> Enum.map(fn {row, number} -> ["\e[#{number};1H", Style.row(row, view.columns)] end)

    # The cursor hides while the frame is written, so that it does not flicker over the map.
    {["\e[?25l", text, cursor(view), "\e[?25h"], view}
  end

  @doc "The screen's rows as styled text, as many as the screen has."
  @spec rows(Scene.t(), t()) :: {[[{String.t(), atom()}]], t()}
  def rows(%Scene{} = scene, %__MODULE__{} = view) do
    spare = view.rows - 24
    answers = if spare >= 12, do: 4, else: 2
    happened = if spare >= 12, do: 4, else: 1
    body_rows = max(view.rows - 3 - answers - happened, 1)
    {body, view} = body(scene, view, body_rows)

    rows =
      [header(scene, view.columns, view.pace)] ++
        body ++
        happened(scene, happened) ++
        answers(view, answers) ++ [[{hint(scene.mission), :dim}], prompt(view)]

    {Enum.take(rows, -view.rows), view}
  end

  # Before all else.
  defp header(%{estop: %{}} = scene, _columns, _pace),
    do: [{" #{Format.estop(scene)}", :alarm}]

  defp header(scene, columns, pace) do
    {kind, spacing} = scene.formation
    ground = Floorplan.of(scene.map)
    name = Path.basename(ground.name)

    place =
      if columns >= 100,
        do:
          "#{name} #{Format.decimals(ground.width, 0)} x #{Format.decimals(ground.height, 0)} m",
        else: name

    [
      {" Convoy ", :title},
      {" #{place}  #{Format.decimals(scene.at_ms / 1000, 1)} s ", :bar},
      {if(pace, do: " #{pace} ", else: ""), :bar},
      {" #{kind} #{Format.decimals(spacing, 1)} m ", :bar},
      {" #{leader(scene)} ", :bar},
      {" #{error(scene)} ", :bar}
    ]
  end

  defp leader(%{leader: nil}), do: "no leader"
  defp leader(scene), do: "#{scene.leader} leads"

  defp error(%{error: nil}), do: ""

  defp error(%{error: {mean, max}} = scene) do
    word = if scene.formed?, do: "formed", else: "position error"
    "#{word} #{Format.decimals(mean, 2)}/#{Format.decimals(max, 2)} m"
  end

  # The last row says how it goes on.
  defp body(_scene, %{overlay: lines} = view, rows) when is_list(lines) do
    lines = Enum.flat_map(lines, &Format.rows(&1, max(view.columns - 3, 20)))
    {shown, left} = lines |> Enum.drop(view.turned) |> Enum.split(max(rows - 2, 1))

    foot =
      if left == [],
        do: "(press Enter to return to the map)",
        else: "(#{Format.count(length(left), "line")} more: press Enter)"

    rows =
      Enum.map(shown, &[{"  " <> &1, :plain}]) ++
        List.duplicate([], max(rows - 1 - length(shown), 0)) ++ [[{"  " <> foot, :dim}]]

    {rows, %{view | page: {length(shown), length(left)}}}
  end

  defp body(scene, view, rows) do
    table? = view.columns >= 72
    columns = if table?, do: view.columns - Table.width() - 1, else: view.columns
    floor = Canvas.floor(view.floor, Floorplan.of(scene.map), scene, columns, rows)
    map = Canvas.draw(floor, scene)

    body =
      if table?,
        do:
          map
          |> Enum.zip(Table.draw(scene, rows))
          |> Enum.map(fn {m, t} -> m ++ [{" ", :plain} | t] end),
        else: map

    {body, %{view | floor: floor}}
  end

  defp happened(scene, count) do
    lines = scene.stages |> Enum.take(-count) |> Enum.map(&[{Format.stage(&1), :plain}])
    List.duplicate([], count - length(lines)) ++ lines
  end

  defp answers(view, count) do
    lines =
      view.messages
      |> Enum.flat_map(&answer(&1, view.columns, count))
      |> Enum.take(count)
      |> Enum.reverse()

    List.duplicate([], count - length(lines)) ++ lines
  end

  # The rows with the last message first; of a message too long for all rows, the beginning says
  # most.
  defp answer({text, style}, columns, count) do
    for row <- text |> Format.rows(max(columns - 2, 20)) |> Enum.take(count) |> Enum.reverse(),
        do: [{" " <> row, style}]
  end

  # A line longer than the screen scrolls, so that the cursor stays visible.
  defp prompt(%{driving: hint}) when is_binary(hint), do: [{hint, :title}]

  defp prompt(view),
    do: [{"> ", :prompt}, {String.slice(Editor.text(view.editor), shift(view)..-1//1), :plain}]

  defp cursor(view), do: "\e[#{view.rows};#{3 + Editor.cursor(view.editor) - shift(view)}H"

  defp shift(view), do: max(0, Editor.cursor(view.editor) - (view.columns - 4))
end
