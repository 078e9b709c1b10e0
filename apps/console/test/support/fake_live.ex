defmodule Console.FakeLive do
  @moduledoc "A fleet for the page that is as a test says, and that notes what it is told."
  alias Hal.Pose
  alias Sim.Scene

  @behaviour Console.Live

  @doc "Starts it with a scene, and what it offers."
  def start_link(scene, offers \\ [:arm]),
    do:
      Agent.start_link(fn -> %{scene: scene, offers: offers, told: [], pace: nil, about: %{}} end)

  @doc "What it was told, the newest last."
  def told(live), do: Agent.get(live, &Enum.reverse(&1.told))

  @doc "Changes the scene by a function."
  def change(live, change), do: Agent.update(live, &%{&1 | scene: change.(&1.scene)})

  @doc "Tells what is known of a robot, besides nothing."
  def know(live, robot, about) do
    about = Map.merge(Console.About.nothing(), about)
    Agent.update(live, &put_in(&1.about[robot], about))
  end

  @doc "A scene of robots in an empty hall; each is told by its name, its place and what is special of it."
  def of(robots, more \\ []) do
    all =
      for {id, {x, y}, about} <- robots do
        Map.merge(
          %{
            id: id,
            pose: Pose.new(x, y, 0.5),
            radius: 0.25,
            corners: [],
            alive: true,
            state: :idle,
            slot: nil,
            leader?: false,
            uncertainty: 0.1,
            size_ppm: nil
          },
          Map.new(about)
        )
      end

    struct!(
      %Scene{
        at_ms: 12_000,
        map: Console.FakeTrial.room("hall", 16.0, 12.0),
        robots: all,
        formation: {:wedge, 1.2}
      },
      more
    )
  end

  @impl Console.Live
  def scene(live), do: Agent.get(live, & &1.scene)

  @impl Console.Live
  def command(live, command) do
    Agent.get_and_update(
      live,
      &{Map.get(&1, :answer, {:ok, "accepted"}), %{&1 | told: [command | &1.told]}}
    )
  end

  @doc "From now on it refuses what it is told, in these words."
  def refuse(live, line), do: Agent.update(live, &Map.put(&1, :answer, {:error, line}))

  @impl Console.Live
  def messages(live), do: Agent.get(live, &Map.get(&1, :messages, {:ok, []}))

  @impl Console.Live
  def nodes(live), do: Agent.get(live, &Map.get(&1, :nodes, {:ok, []}))

  @doc "Its nodes."
  def place(live, nodes), do: Agent.update(live, &Map.put(&1, :nodes, nodes))

  @doc "What its robots have said to each other."
  def say(live, messages), do: Agent.update(live, &Map.put(&1, :messages, messages))

  @impl Console.Live
  def pace(live), do: Agent.get(live, & &1.pace)

  @doc "How fast it says to go."
  def paced(live, pace), do: Agent.update(live, &%{&1 | pace: pace})

  @impl Console.Live
  def offers(live), do: Agent.get(live, & &1.offers)

  @impl Console.Live
  def lines(_live), do: ["one line"]

  @impl Console.Live
  def ended(_live), do: nil

  @impl Console.Live
  def result(_live), do: %{}

  @impl Console.Live
  def stop(live), do: Agent.stop(live)

  @impl Console.Live
  def notice(_live), do: nil

  @impl Console.Live
  def status(live, _whom), do: live |> scene() |> Console.Cli.Format.everybody()

  @impl Console.Live
  def statuses(live) do
    for robot <- scene(live).robots, robot.alive do
      about = Map.take(robot, [:pose, :state, :uncertainty, :frame, :arming, :says, :leader])
      struct!(%Swarm.Status{robot: robot.id, age_ms: 40}, about)
    end
  end

  @impl Console.Live
  def about(live, robot), do: Agent.get(live, & &1.about[robot])
end
