defmodule Bench.Page do
  @moduledoc """
  Measures what the page costs, or what is served in its place (`Console.Page.Service`), whose clients ask for all there is. In turns nobody looks, some browsers do, and some connect and read nothing; they are sockets
  of another VM (`Bench.Page.Browsers`).

  How steadily robots tick is measured on a fleet of processes; their own work changes by more than the page takes, so
  what that is, in processor time of the VM, is measured on the same robots in lockstep, which are in formation and stand still.
  """
  alias Bench.Page.Browsers
  alias Bench.Table
  alias Console.{Live, Page}
  alias Robot.Board

  # How often it is looked when a robot has ticked last; how long a turn is left to begin.
  @sample_ms 20
  @begin_ms 1_000
  # How long the fleet is waited for.
  @form_ms 90_000

  @typedoc "One turn: the share of a core (%), ticks a second of the slowest robot, the longest time without a tick (ms)."
  @type turn :: %{cpu: float(), hz: float(), gap_ms: non_neg_integer()}
  @type who :: :nobody | :readers | :deaf

  @doc "Measures so many rounds of turns, each of so many seconds."
  @spec measure(%{atom() => pos_integer() | atom()}, (String.t() -> term())) ::
          {:ok, %{who() => [turn()]}} | {:error, line :: String.t()}
  def measure(%{robots: robots} = given, note) do
    robots = Console.Fleet.of(robots)
    vm = Vm.start_one()

    with {:ok, steady} <- fleet(robots, vm, given, note),
         {:ok, costs} <- lockstep(robots, vm, given, note) do
      Vm.stop([vm])

      {:ok,
       Map.new(steady, fn {who, turns} ->
         {who, Enum.zip_with(turns, costs[who], &Map.merge/2)}
       end)}
    end
  end

  defp fleet(robots, vm, given, note) do
    with {:ok, fleet} <- Lab.Fleet.start_link(robots: robots, blobs: :direct),
         {:ok, page, url} <- serve(given, module: Live.Fleet, live: fleet, robots: robots) do
      note.("the fleet forms")
      formed(fn -> Lab.Fleet.scene(fleet).formed? end, Hal.Clock.now_ms() + @form_ms)
      boards = Enum.map(robots, &Board.find!/1)
      turns = turns(vm, url, robots, given, note, &steady(boards, &1))
      :ok = Supervisor.stop(page)
      :ok = Lab.Fleet.stop(fleet)
      {:ok, turns}
    end
  end

  defp lockstep(robots, vm, given, note) do
    with {:ok, options} <-
           Console.Options.parse(["--robots", "#{length(robots)}", "--blobs", "direct"]),
         {:ok, live} <-
           Live.Trial.start_link(
             Lab.Trial,
             Console.Options.trial(options),
             Console.Pace.new(:max)
           ),
         {:ok, page, url} <- serve(given, module: Live.Trial, live: live, robots: robots) do
      note.("the fleet forms in lockstep")
      formed(fn -> Live.Trial.scene(live).formed? end, Hal.Clock.now_ms() + @form_ms)
      {:ok, _paused} = Live.Trial.command(live, {:pace, :pause})
      turns = turns(vm, url, robots, given, note, &cost/1)
      :ok = Supervisor.stop(page)
      :ok = Live.Trial.stop(live)
      {:ok, turns}
    end
  end

  defp serve(%{service: :page}, options), do: Page.start_link(options)

  defp serve(%{service: name}, options) do
    {_port, module} = Keyword.fetch!(Page.Service.all(), name)
    Page.start_link([service: module] ++ options)
  end

  # What a client says at first, to hear all there is.
  defp asked(%{service: :page}, _robots), do: []

  defp asked(%{service: :foxglove}, robots) do
    count = length(Bridge.Topics.list(robots))
    asked = for id <- 1..count, do: %{id: id, channelId: id}
    [%{op: "subscribe", subscriptions: asked}]
  end

  defp asked(%{service: :rosbridge}, robots) do
    for %{key: {_topic, :none}, name: name} <- Bridge.Ros.list(robots),
        do: %{op: "subscribe", topic: name}
  end

  defp turns(vm, url, robots, given, note, measure) do
    %URI{port: port} = URI.parse(url)
    words = given |> asked(robots) |> Enum.map(&Hal.Json.encode!/1)

    turns =
      for round <- 1..given.rounds,
          {who, count} <- [nobody: 0, readers: given.clients, deaf: given.slow] do
        note.("round #{round} of #{given.rounds}, #{who}")
        browsers = Vm.call(vm, Browsers, :start, [port, count, who, words], 70_000)
        wait(@begin_ms)
        turn = measure.(given.seconds * 1_000)
        :ok = Vm.call(vm, Browsers, :stop, [browsers])
        {who, turn}
      end

    Enum.group_by(turns, &elem(&1, 0), &elem(&1, 1))
  end

  # Until then the work of the robots changes from turn to turn.
  defp formed(formed?, until_ms) do
    unless formed?.() or Hal.Clock.now_ms() > until_ms do
      wait(@begin_ms)
      formed(formed?, until_ms)
    end
  end

  defp cost(ms) do
    {cpu_ms, _since} = :erlang.statistics(:runtime)
    began_ms = Hal.Clock.now_ms()
    wait(ms)
    {then_ms, _since} = :erlang.statistics(:runtime)
    %{cpu: 100 * (then_ms - cpu_ms) / (Hal.Clock.now_ms() - began_ms)}
  end

  defp steady(boards, ms) do
    {began_ms, ticks} = {Hal.Clock.now_ms(), Enum.map(boards, &tick/1)}
    gap_ms = gap(boards, began_ms + ms, 0)
    counts = Enum.zip_with(Enum.map(boards, &tick/1), ticks, &(&1 - &2))
    %{hz: 1_000 * Enum.min(counts) / (Hal.Clock.now_ms() - began_ms), gap_ms: gap_ms}
  end

  defp gap(boards, until_ms, most) do
    if Hal.Clock.now_ms() >= until_ms do
      most
    else
      wait(@sample_ms)
      gap(boards, until_ms, Enum.max([most | Enum.map(boards, &age/1)]))
    end
  end

  defp wait(ms), do: receive(do: (:never -> :ok), after: (ms -> :ok))

  defp tick(board), do: with({:ok, doing, _at_ms} <- doing(board), do: doing.tick)

  defp age(%{clock: {m, f, a}} = board),
    do: with({:ok, _doing, at_ms} <- doing(board), do: apply(m, f, a) - at_ms)

  defp doing(board), do: Board.fetch(board, :doing, :infinity)

  @doc """
  The table in Markdown: medians of the turns, the longest of all gaps, and what is more than with nobody.

      iex> turn = fn cpu, gap_ms -> %{cpu: cpu, hz: 10.0, gap_ms: gap_ms} end
      iex> table = Bench.Page.draw(%{nobody: [turn.(50.0, 120)], readers: [turn.(56.5, 130)], deaf: [turn.(51.0, 125)]})
      iex> table |> String.split("\\n") |> Enum.at(3)
      "| readers | 56.5 % | 6.5 % | 10.0 Hz | 130 ms |"
  """
  @spec draw(%{who() => [turn()]}) :: String.t()
  def draw(turns) do
    none = median(turns.nobody, :cpu)

    head = """
    | who looks | of a core | more than with nobody | the slowest robot ticks | longest without a tick |
    |---|---|---|---|---|
    """

    head <>
      Enum.map_join([:nobody, :readers, :deaf], "\n", fn who ->
        cpu = median(turns[who], :cpu)
        gap_ms = turns[who] |> Enum.map(& &1.gap_ms) |> Enum.max()

        "| #{who} | #{decimal(cpu)} % | #{if who == :nobody, do: "–", else: decimal(cpu - none) <> " %"} | " <>
          "#{decimal(median(turns[who], :hz))} Hz | #{gap_ms} ms |"
      end)
  end

  defp median(turns, key), do: turns |> Enum.map(&Map.fetch!(&1, key)) |> Table.quantile(0.5)
  defp decimal(number), do: Console.Cli.Format.decimals(number, 1)
end
