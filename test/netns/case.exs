Code.require_file("load.exs", __DIR__)

defmodule Netns.Case do
  @moduledoc """
  Five whole robots, each on a node of its own in a network namespace of its own, in one world of
  bodies that no cut of the network touches: real radios, real distribution, real time. What is
  asserted is read from the logs that the nodes write.

  Never do two that reach each other both lead for longer than a lease. Where the network has just
  brought the two together, that counts from 2 s after it did (`Netns.Story.two_leaders/1`). All that
  commit a round commit the same. Healed, all are one formation within 10 s.

  The landmark stands at {0, 0}; the robots begin about where they will stand, abreast, so that what
  is measured is how they agree, and not how far they drive. With `FIGURES=1` each test prints what it has measured.
  """
  use ExUnit.CaseTemplate
  import Swarm.Case, only: [order: 1]
  alias Netns.{Fleet, Story}
  alias Lab.Node.Log
  alias Vm.Net

  using do
    quote do
      import Netns.Case
      import Swarm.Case, only: [order: 1]
      alias Netns.{Fleet, Story}
      alias Lab.Node.Log
      alias Vm.Net
      @moduletag :realtime
      @moduletag timeout: 120_000
      @moduletag skip: Net.why_not()
      # The first leads; each robot's place in this line is where it stands in the other one, too.
      @larger [:mag1, :mag2, :mag4]
      @smaller [:mag3, :mag5]
      @parts [@larger, @smaller]
      @all Netns.Case.all()
      @gone_ms 2_000
      # Till then what is judged by the logs' times has happened on the busiest machine.
      @patience_ms 60_000
    end
  end

  @all [:mag1, :mag2, :mag3, :mag4, :mag5]
  @mission [formation: {:line, 1.0}, assign: :cost]

  @lease_ms 1_500
  # How far from its place a body may stand: 0.25 m by its own judgement, and what it errs itself.
  @place_m 0.35
  # Till then what is judged by the logs' times has happened on the busiest machine.
  @patience_ms 60_000

  @doc "The robots, abreast."
  def all, do: @all

  setup do
    folder =
      Path.join(System.tmp_dir!(), "convoy-netns-#{System.pid()}-#{:rand.uniform(1_000_000)}")

    File.mkdir_p!(folder)

    {:ok, fleet} =
      Fleet.start_link(
        {Lab.Node.Fleet.abreast(@all), folder, :persistent_term.get(:netns_modules), []}
      )

    net = Fleet.net(fleet)
    on_exit(fn -> Net.delete(net) end)
    met(fleet)
    %{fleet: fleet}
  end

  @doc "All know all, by both ways."
  def met(fleet) do
    Fleet.await(fleet, "all have met", @patience_ms, fn _lines ->
      Enum.all?(@all, fn robot ->
        Fleet.call(fleet, robot, Swarm.Directory, :robots, []) == @all and
          map_size(Fleet.call(fleet, robot, Mesh, :robots, [])) == length(@all) - 1
      end)
    end)
  end

  @doc "Starts the mission. Says when."
  def start(fleet, options \\ []) do
    :ok = order(fn -> Fleet.call(fleet, :mag1, Swarm, :start, [@mission ++ options]) end)
    Log.now()
  end

  @doc "When it first held, by the logs, in ms from then on."
  def when?(fleet, what, from, holds?) do
    us = Fleet.await(fleet, what, @patience_ms, &Story.first(&1, from, holds?))
    since(us, from)
  end

  @doc "When one led these, in ms from then on."
  def led(fleet, from, robots),
    do: when?(fleet, "one leads #{inspect(robots)}", from, &(Story.leader(&1, robots) != nil))

  @doc "When these were formed, in ms from then on."
  def formed(fleet, from, robots \\ @all) do
    ms = when?(fleet, "#{inspect(robots)} are formed", from, &Story.formed?(&1, robots))
    now = Story.now(Fleet.lines(fleet))
    assert Story.error(now, Story.leader(now, robots)) <= @place_m
    ms
  end

  @doc "Which robot leads these, if one does."
  def leader(fleet, robots \\ @all), do: Story.leader(Story.now(Fleet.lines(fleet)), robots)
  @doc "From then to then, in ms."
  def since(us, from), do: (us - from) / 1_000

  @doc "Who has led, or followed whom, since then, where that is another than before."
  def changes(fleet, from) do
    {before, later} = Enum.split_while(Fleet.lines(fleet), &(elem(&1, 0) < from))
    now = Story.now(before)

    for {_, who, :claim, claim} <- later,
        role(claim) != role(now.claims[who]),
        do: {who, claim}
  end

  defp role(claim), do: claim && {claim.phase, claim.leader, claim.epoch}

  @doc "Lets time pass with the network as it is."
  def last(from, ms) do
    rest = max(ceil(ms - since(Log.now(), from)), 0)
    Process.send_after(self(), :over, rest)
    assert_receive :over, rest + 1_000
  end

  @doc "All that is told of these robots since then, of one kind."
  def told(fleet, kind, from, robots \\ @all) do
    for {us, who, ^kind, value} <- Story.lines(Fleet.lines(fleet), kind, from, robots),
        do: {who, since(us, from), value}
  end

  @doc """
  What must hold in every run, whatever was done to the network. `from` is when the mission was started
  last: a new one counts its rounds anew.
  """
  def lawful(fleet, what, from, figures) do
    lines = Fleet.lines(fleet)
    both = Story.two_leaders(lines)
    assert both.late <= @lease_ms, "two led for #{both.late} ms"

    assert Story.torn_rounds(lines, from) == []

    if System.get_env("FIGURES") do
      figures = figures ++ [two_leaders: both.all, late: both.late]

      IO.puts(
        "#{what}: " <> Enum.map_join(figures, ", ", fn {k, ms} -> "#{k} #{round(ms)} ms" end)
      )
    end
  end
end
