defmodule Agents.Answerers do
  @moduledoc "Services for tests; compiled, so that they run on other nodes too."

  defmodule Echo do
    @moduledoc """
    Answers questions; it does not answer `:silent`, raises at `:raise`, and ends at `:die`.
    """
    @behaviour Agents.Responder

    @impl Agents.Responder
    def init(robot, argument), do: %{robot: robot, argument: argument, heard: 0}

    @impl Agents.Responder
    def handle(%{content: :silent}, s), do: {:noreply, s}
    def handle(%{content: :raise}, _s), do: raise("told to")
    def handle(%{content: :die}, _s), do: Process.exit(self(), :kill)
    def handle(%{content: :nonsense}, s), do: {{:shout, 1}, s}
    def handle(%{content: :heard}, s), do: {{:inform, s.heard}, s}

    def handle(%{content: {:tell, pid}} = envelope, s) do
      send(pid, {:told, s.robot, envelope})
      {:noreply, s}
    end

    def handle(%{content: content}, s), do: {{:inform, content}, %{s | heard: s.heard + 1}}
  end

  @doc "Starts some echoes that outlive the process that started them: for other nodes."
  @spec start([atom()], atom()) :: [pid()]
  def start(names, service) do
    for name <- names do
      {:ok, pid} = Agents.Responder.start_link(name, service: service, module: Echo)
      Process.unlink(pid)
      pid
    end
  end

  @doc "Starts a bidder that bids this much for tasks, for another node."
  @spec start_bidder(atom(), Agents.ContractNet.Cost.t()) :: pid()
  def start_bidder(name, cost) do
    options = [
      service: :tasks,
      module: Agents.ContractNet.Bidding,
      argument: {__MODULE__.Carry, cost}
    ]

    {:ok, pid} = Agents.Responder.start_link(name, options)
    Process.unlink(pid)
    pid
  end

  @doc "Starts a responder that hears a topic."
  @spec start_topic(Agents.Envelope.topic()) :: pid()
  def start_topic(topic) do
    options = [service: :topic_far, module: Echo, topics: [topic]]
    {:ok, pid} = Agents.Responder.start_link(:topic_far, options)
    Process.unlink(pid)
    pid
  end
end

defmodule Agents.Answerers.Carry do
  @moduledoc "Bids its argument for `{:carry, _}`, and does what the task says."
  @behaviour Agents.ContractNet

  @impl Agents.ContractNet
  def cost({:carry, _how}, _robot, cost), do: cost
  def cost(:raise, _robot, _cost), do: raise("told to")
  def cost(_other, _robot, _cost), do: :infinite

  @impl Agents.ContractNet
  def work({:carry, {:tell, pid}}, robot, _cost, report) do
    report.(:on_my_way)
    send(pid, {:working, robot, self()})
    receive do: (:go_on -> {:carried_by, robot})
  end

  def work({:carry, :fail}, _robot, _cost, _report), do: exit(:told_to)
  def work({:carry, _how}, robot, _cost, _report), do: {:carried_by, robot}
end
