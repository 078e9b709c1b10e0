defmodule Console.Live.Fleet do
  @moduledoc """
  Runs a fleet of complete robots in real time: each robot has its own tree of processes, and `Swarm` commands it as it
  commands real ones.
  """
  @behaviour Console.Live
  alias Console.Cli.Format
  alias Console.{About, Nodes}
  alias Lab.Fleet

  @doc "Starts a fleet; the error says in one line what is wrong with its options."
  @spec start_link(map()) :: {:ok, pid()} | {:error, String.t()}
  def start_link(options), do: Fleet.start_link(options)

  @impl Console.Live
  def scene(live), do: Fleet.scene(live)

  @impl Console.Live
  def ended(live), do: Fleet.ended(live)

  @impl Console.Live
  def result(live), do: Fleet.result(live)

  @impl Console.Live
  def pace(_live), do: nil

  @impl Console.Live
  def lines(live), do: Fleet.lines(live)

  @impl Console.Live
  def stop(live), do: Fleet.stop(live)

  @impl Console.Live
  def offers(_live), do: [:kill, :landmark, :place]

  @impl Console.Live
  def notice(live), do: ended(live)

  @impl Console.Live
  def status(live, :all), do: live |> scene() |> Format.everybody()
  def status(live, robot), do: live |> scene() |> Format.one(robot)

  @impl Console.Live
  def statuses(live) do
    living = Fleet.living(live)
    for status <- Swarm.status(), status.robot in living, do: status
  end

  @impl Console.Live
  def about(live, robot), do: About.of(robot) || elsewhere(robot, Fleet.living(live))

  @impl Console.Live
  def messages(live), do: Fleet.messages(live)

  @impl Console.Live
  def nodes(live), do: {:ok, live |> Fleet.living() |> Nodes.look()}

  # A process of its own has its board there.
  defp elsewhere(robot, living) do
    with true <- robot in living, %Swarm.Status{} = status <- Swarm.status(robot) do
      status |> About.of_status() |> About.with_layer(Swarm.layer(robot))
    else
      _dead_or_unknown -> nil
    end
  end

  @impl Console.Live
  def command(live, command) do
    case carry_out(command, live) do
      :ok -> {:ok, told(command)}
      {:ok, said} -> {:ok, said}
      {:error, line} -> {:error, line}
    end
  end

  # `:ok` means that robots have accepted the command, not that they reach their goals.
  defp told({:kill, _who}), do: "done"
  defp told({:place, _who, _place}), do: "done"
  defp told(_order), do: "accepted"

  defp carry_out({:kill, who}, live), do: Fleet.kill(live, who)
  defp carry_out({:landmark, :none}, live), do: Fleet.move_landmark(live, nil)
  defp carry_out({:landmark, place}, live), do: Fleet.move_landmark(live, place)

  defp carry_out({:place, who, place}, live), do: Fleet.place(live, who, place)

  defp carry_out({:tell, target, {:send, text} = message}, live) do
    with :ok <- Swarm.tell(target, message), do: Fleet.written(live, target, text)
  end

  defp carry_out({:tell, target, command}, live) do
    with :ok <- on_floor(command, Fleet.scene(live).map), do: Swarm.tell(target, command)
  end

  defp carry_out({:program, robot, what, name}, _live), do: Nodes.order(robot, what, name)
  defp carry_out(:estop, _live), do: Swarm.estop()
  defp carry_out(:reset, _live), do: Swarm.reset()

  defp carry_out({:pace, _command}, _live),
    do:
      {:error,
       "live robots run in real time and cannot be paused; with --speed 1 the demo runs in lockstep, and can be"}

  # Another shape keeps the current spacing of the robots.
  defp carry_out({:formation, {kind, spacing}}, live) do
    {_kind, present} = Fleet.scene(live).formation
    Swarm.formation(kind, spacing: spacing || present)
  end

  # Robots have no map, so only here can one see that a place is in a wall.
  defp on_floor({:goto, x, y, _heading}, map) do
    if Sim.Floorplan.wall?(map, {x, y}) do
      {width, height} = Sim.Floorplan.size(map)
      size = "#{Format.decimals(width, 1)} x #{Format.decimals(height, 1)} m"
      {:error, "no robot can stand at #{x},#{y}: map #{map.name} is #{size}, and that is a wall"}
    else
      :ok
    end
  end

  defp on_floor(_no_place, _map), do: :ok
end
