defmodule Player.Source do
  @moduledoc """
  Asks a live fleet (`Console.Live`) for its scene, and what is known of a robot, for `Bridge.Hub`; of a robot of this node the
  newest readings of its board besides. What is known of a robot elsewhere is what the page knows: its pose, speed, ranges and battery.

  `live` is the module and the fleet.
  """
  alias Hal.{Pose, Profile}
  alias Robot.{Board, Names}

  @type live :: {module(), live :: term()}

  @typedoc """
  What does not change of a robot: its body, `nil` if that is not known here; where its sonars are and look; whether it shows pictures.
  """
  @type body :: %{profile: Profile.t() | nil, sonars: [Pose.t()], pictures?: boolean()}

  # Older ones tell nothing of now (ms).
  @readings [
    sonar: 300,
    ir: 300,
    bumpers: 300,
    scan: 500,
    ptz: 500,
    detections: 500,
    power: 60_000,
    uncertainty: 1_000,
    pose: 1_000
  ]

  @doc "The fleet as it is now."
  @spec scene(live()) :: Sim.Scene.t()
  def scene({module, live}), do: module.scene(live)

  @doc "Carries out what was ordered (`c:Console.Live.command/2`)."
  @spec command(live(), Console.Live.command()) :: {:ok, String.t()} | {:error, String.t()}
  def command({module, live}, command), do: module.command(live, command)

  @doc "What is known of a robot (`Console.About`), with its `readings` by key (`Robot.Board`) and its `profile`, if it is on this node."
  @spec about(live(), atom()) :: map() | nil
  def about({module, live}, robot) do
    with %{} = about <- module.about(live, robot),
         do: Map.merge(about, robot |> Board.find() |> readings())
  end

  defp readings(:error), do: %{readings: %{}}

  defp readings({:ok, board}) do
    readings =
      for {key, most_ms} <- @readings,
          {:ok, value, _at_ms} <- [Board.fetch(board, key, most_ms)],
          into: %{},
          do: {key, value}

    with {:ok, %{profile: profile}, _at_ms} <- Board.fetch(board, :release, :infinity),
         do: %{readings: readings, profile: profile},
         else: (:error -> %{readings: %{}})
  end

  @doc "The body of a robot."
  @spec body(live(), atom()) :: body()
  def body({module, live}, robot) do
    pictures? = Names.whereis(robot, :view) != nil

    with {:ok, board} <- Board.find(robot),
         {:ok, %{profile: profile}, _at_ms} <- Board.fetch(board, :release, :infinity) do
      # Not every base with infrareds reports them.
      irs = if Board.fetch(board, :ir, :infinity) == :error, do: [], else: profile.irs
      %{profile: %{profile | irs: irs}, sonars: profile.sonars, pictures?: pictures?}
    else
      _elsewhere ->
        beams = with %{sonar: beams} <- module.about(live, robot), do: beams
        sonars = for [x, y, heading, _range] <- beams || [], do: Pose.new(x, y, heading)
        %{profile: nil, sonars: sonars, pictures?: pictures?}
    end
  end
end
