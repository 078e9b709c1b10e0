defmodule Bridge.Rmf.Manager do
  @moduledoc """
  Keeps what fleet adapters of Open-RMF have commanded (`Bridge.Rmf.Command`), and asks for the status of all robots four times a
  second while one asks here. So no robot answers ten times a second to an adapter that does ask as often.
  """
  use GenServer
  alias Bridge.Rmf.Command
  alias Hal.Clock
  alias Swarm.Status

  @tick_ms 250
  # An adapter that has not asked for so long is gone.
  @asked_ms 2_000

  @doc "Starts it for a fleet (`c:Console.Page.Service.feed/1`)."
  @spec start_link(map()) :: GenServer.on_start()
  def start_link(source), do: GenServer.start_link(__MODULE__, source)

  @doc "That of a server of the page."
  @spec of(page :: pid()) :: pid()
  def of(page) do
    {__MODULE__, manager, _type, _modules} =
      page |> Supervisor.which_children() |> List.keyfind(__MODULE__, 0)

    manager
  end

  @doc "The fleet: `module` and `live` as in `Console.Live`."
  @spec source(pid()) :: {module(), live :: term()}
  def source(manager), do: GenServer.call(manager, :source)

  @doc "Robots as they were looked at last, each with what is told of its commands: one by name, or all."
  @spec robots(pid(), String.t() | :all) :: [{robot :: map(), told :: map()}]
  def robots(manager, which), do: GenServer.call(manager, {:robots, which})

  @doc "A command is asked for: `:same` if the robot has it, else the caller gives it and says so (`given/3`)."
  @spec asked(pid(), robot :: atom(), integer(), Hal.Pose.t() | :stop) :: :same | :new
  def asked(manager, robot, id, goal), do: GenServer.call(manager, {:asked, robot, id, goal})

  @doc "The robot has accepted it."
  @spec given(pid(), robot :: atom(), integer()) :: :ok
  def given(manager, robot, id), do: GenServer.call(manager, {:given, robot, id})

  @impl GenServer
  def init(source),
    do: {:ok, Map.merge(source, %{commands: %{}, seen: %{}, asked_ms: nil, ticking?: false})}

  @impl GenServer
  def handle_call(:source, _from, s), do: {:reply, {s.module, s.live}, s}

  def handle_call({:robots, which}, _from, s) do
    s = %{s | asked_ms: Clock.now_ms()}
    s = if s.ticking?, do: s, else: s |> look() |> tick()

    {robots, commands} =
      s.seen
      |> Enum.filter(fn {id, _robot} -> which in [:all, Atom.to_string(id)] end)
      |> Enum.sort()
      |> Enum.map_reduce(s.commands, fn {id, robot}, commands ->
        {told, command} = commands |> Map.get(id, %Command{}) |> Command.told()
        {{robot, told}, Map.put(commands, id, command)}
      end)

    {:reply, robots, %{s | commands: commands}}
  end

  def handle_call({:asked, robot, id, goal}, _from, s) do
    {answer, command} = s.commands |> Map.get(robot, %Command{}) |> Command.asked(id, goal)
    {:reply, answer, put_in(s.commands[robot], command)}
  end

  def handle_call({:given, robot, id}, _from, s) do
    now_ms = Clock.now_ms()
    {:reply, :ok, update_in(s.commands[robot], &Command.given(&1, id, now_ms))}
  end

  @impl GenServer
  def handle_info(:tick, s) do
    if Clock.now_ms() - s.asked_ms < @asked_ms,
      do: {:noreply, s |> look() |> tick()},
      else: {:noreply, %{s | ticking?: false}}
  end

  defp tick(s) do
    _timer = Process.send_after(self(), :tick, @tick_ms)
    %{s | ticking?: true}
  end

  defp look(s) do
    at_ms = Clock.now_ms()
    seen = Map.new(statuses(s), &{&1.robot, robot(&1)})

    commands =
      Map.new(s.commands, fn {id, command} ->
        case seen do
          %{^id => robot} -> {id, Command.seen(command, robot, s.seen[id], at_ms)}
          _gone -> {id, command}
        end
      end)

    %{s | seen: seen, commands: commands}
  end

  defp statuses(%{module: module, live: live}),
    do: if(function_exported?(module, :statuses, 1), do: module.statuses(live), else: [])

  # By its own word: one that is lost, or does not answer, has no place.
  defp robot(%Status{frame: frame, state: state} = status)
       when frame == :lost or state == :no_answer,
       do: %{id: status.robot, state: state, pose: nil}

  defp robot(status),
    do: %{id: status.robot, state: status.state, pose: status.pose, speed: status.speed}
end
