defmodule Console.Live.Mesh do
  @moduledoc """
  Shows the robots of the mesh that this node is part of, however they were started: what `bin/console` shows on its page.

  It asks four times a second for their status, and once a second for what the mission of a robot draws that a page shows, and
  commands them, by `Swarm` alone, as a person does in a shell. No robot
  knows it: whether it hangs or dies changes nothing for them. Robots that come are shown by themselves, robots that have
  gone as no longer heard.
  """
  use GenServer
  alias Console.Live.Mesh.{Notice, View}
  alias Console.{About, Nodes}
  alias Hal.Ticker
  alias Swarm.Status
  @behaviour Console.Live

  @period_ms 250
  # A drawing may have 64 kB, and changes slowly.
  @layer_ms 1_000

  @doc "Starts it. `connect` is the node that a person expects to hear, as text, `nil` for none in particular."
  @spec start_link(connect: String.t() | nil) :: GenServer.on_start()
  def start_link(options \\ []), do: GenServer.start_link(__MODULE__, options[:connect])

  @doc "The robots that were ever heard, the first of them first."
  @spec robots(pid()) :: [atom()]
  def robots(live), do: GenServer.call(live, :robots)

  @impl Console.Live
  def scene(live), do: GenServer.call(live, :scene)

  @impl Console.Live
  def notice(live), do: GenServer.call(live, :notice)

  @impl Console.Live
  def offers(_live), do: [:arm]

  @impl Console.Live
  def pace(_live), do: nil

  @impl Console.Live
  def ended(_live), do: nil

  @impl Console.Live
  def result(_live), do: %{}

  @impl Console.Live
  def lines(live), do: live |> robots() |> Nodes.look() |> Nodes.lines()

  @impl Console.Live
  def nodes(live), do: {:ok, live |> robots() |> Nodes.look()}

  @impl Console.Live
  def statuses(live), do: GenServer.call(live, :statuses)

  @impl Console.Live
  def status(live, :all), do: Enum.map(statuses(live), &inspect/1)
  def status(live, robot), do: for(%Status{} = one <- [one(live, robot)], do: inspect(one))

  @impl Console.Live
  def about(live, robot) do
    with %Status{} = status <- one(live, robot),
         do: status |> About.of_status() |> About.with_layer(layer(live, status))
  end

  # Only one that answers is asked, however many pages show it.
  defp layer(live, %Status{from: :robot, robot: robot}), do: GenServer.call(live, {:layer, robot})
  defp layer(_live, _row), do: {:ok, []}

  @impl Console.Live
  def messages(_live) do
    {:error,
     "what real robots say to each other goes from node to node, and not to this one; a recording has it: mix replay FILE --page"}
  end

  defp one(live, robot), do: Enum.find(statuses(live), &(&1.robot == robot))

  # In the caller's process, so that no robot that is slow to answer delays what is shown.
  @impl Console.Live
  def command(_live, command) do
    case carry_out(command) do
      :ok -> {:ok, "accepted"}
      {:ok, said} -> {:ok, said}
      {:error, line} -> {:error, line}
    end
  end

  defp carry_out({:tell, target, command}), do: Swarm.tell(target, command)
  defp carry_out({:formation, {kind, nil}}), do: Swarm.formation(kind)
  defp carry_out({:formation, {kind, spacing}}), do: Swarm.formation(kind, spacing: spacing)
  defp carry_out({:program, robot, what, name}), do: Nodes.order(robot, what, name)
  defp carry_out(:estop), do: Swarm.estop()
  defp carry_out(:reset), do: Swarm.reset()
  defp carry_out({word, _what}), do: {:error, "#{word} is for simulated fleets only"}

  @impl Console.Live
  def stop(live), do: GenServer.stop(live)

  @impl GenServer
  def init(connect) do
    {:ok,
     %{
       begun_ms: Hal.Clock.now_ms(),
       view: View.new(),
       notice: Notice.new(connect),
       asked: nil,
       layers: %{},
       ticker: Ticker.start(:tick, @period_ms, 0)
     }}
  end

  @impl GenServer
  def handle_call(:robots, _from, s), do: {:reply, View.robots(s.view), s}

  def handle_call(:scene, _from, s),
    do: {:reply, View.scene(s.view, Hal.Clock.now_ms() - s.begun_ms), s}

  def handle_call(:notice, _from, s), do: {:reply, s.notice.line, s}
  def handle_call(:statuses, _from, s), do: {:reply, View.statuses(s.view), s}

  # What the robot said last; it is asked again for the next time.
  def handle_call({:layer, robot}, _from, s) do
    now_ms = Hal.Clock.now_ms()
    {layer, due_ms} = Map.get(s.layers, robot, {{:ok, []}, now_ms})

    if now_ms < due_ms do
      {:reply, layer, s}
    else
      _task = Task.async(fn -> {:layer, robot, Swarm.layer(robot)} end)
      {:reply, layer, %{s | layers: Map.put(s.layers, robot, {layer, now_ms + @layer_ms})}}
    end
  end

  # An answer that takes longer than the period is waited for, and none is asked for twice.
  @impl GenServer
  def handle_info(:tick, %{asked: nil} = s) do
    %Task{ref: ref} = Task.async(&Swarm.status/0)
    {:noreply, %{s | asked: ref, ticker: Ticker.next(s.ticker)}}
  end

  def handle_info(:tick, s), do: {:noreply, %{s | ticker: Ticker.next(s.ticker)}}

  def handle_info({ref, statuses}, %{asked: ref} = s) do
    Process.demonitor(ref, [:flush])
    view = View.update(s.view, statuses, clock(), Hal.Clock.now_ms() - s.begun_ms)

    {:noreply,
     %{s | asked: nil, view: view, notice: Notice.look(s.notice, seen(view), Hal.Clock.now_ms())}}
  end

  def handle_info({ref, {:layer, robot, layer}}, s) do
    Process.demonitor(ref, [:flush])

    {:noreply,
     %{s | layers: Map.update!(s.layers, robot, fn {_old, due_ms} -> {layer, due_ms} end)}}
  end

  # What the mesh says of itself; `nil` for nodes where there is none.
  defp seen(view) do
    nodes = if Mesh.running?(), do: for({node, %{status: :alive}} <- Mesh.view().nodes, do: node)

    %{
      robots: length(View.living(view)),
      nodes: nodes && Enum.map(nodes, &Atom.to_string/1),
      unsigned: Map.get(Mesh.rejected(), :unsigned, 0),
      fault: Mesh.fault()
    }
  end

  defp clock do
    {_date, {hour, minute, second}} = :calendar.local_time()
    to_string(:io_lib.format("~2..0B:~2..0B:~2..0B", [hour, minute, second]))
  end
end
