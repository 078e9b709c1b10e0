defmodule Agents.Programs do
  @moduledoc """
  Starts and ends programs on a robot that runs: a companion that the configuration gives each robot, with the programs of this build.

      config :swarm, companions: [{Agents.Programs, battery: Agents.Battery, power: {MyApp.Power, 11.5}}]

  A program is an `Agents.Responder`: the name is that of its service, and the module may stand with an argument. It is reached at
  `{:mag1, :programs}` as any other service:

  | envelope | answer |
  |---|---|
  | `:query`, `:programs` | `:inform`, `[{"battery", runs?}]` |
  | `:request`, `{:start, "battery", giver}` | `:inform`, `"battery"`, once it runs; `:refuse` with one line |
  | `:request`, `{:end, "battery", giver}` | `:inform`, `"battery"`, once it has ended; `:refuse` with one line |

  The giver is the text of `Swarm.by/2` or `nil`; the robot's log has it. A program ends when its robot ends, and when a
  part of the robot crashes. One that crashes takes no part of the robot along. None is started again by itself. One that hangs is killed
  after 0.3 s when it is to end; one that hangs while it starts keeps all others from starting and ending. What the robot's file has as a
  companion is none of these: it is not ended here.

      Robot.Supervisor mag1
      `-- Agents.Programs
          |-- DynamicSupervisor      the programs
          `-- Agents.Responder       which answers
  """
  use Supervisor
  alias Agents.Responder
  alias Hal.{Event, Options}
  alias Robot.Names
  alias Swarm.Order.Giver

  @behaviour Robot.Companion
  @behaviour Responder

  @service :programs
  # How long the end of a program may take, and that of all: the robot's supervisor waits meanwhile, and restarts nothing.
  @end_ms 300
  @end_all_ms 1_000

  @typedoc "The programs of a build: by the name of the service the module, with its argument or without."
  @type catalogue :: [{atom(), module() | {module(), argument :: term()}}]

  @impl Robot.Companion
  def child_spec({%Robot.Config{id: id}, catalogue}),
    do: %{
      id: __MODULE__,
      start: {__MODULE__, :start_link, [id, catalogue]},
      type: :supervisor
    }

  @doc "Starts it for a robot. `Robot.Names` must be running."
  @spec start_link(robot :: atom(), catalogue()) :: Supervisor.on_start()
  def start_link(robot, catalogue),
    do: Supervisor.start_link(__MODULE__, {robot, catalogue})

  @impl Supervisor
  def init({robot, catalogue}) do
    answers = [service: @service, module: __MODULE__, argument: catalogue]
    options = [strategy: :one_for_one, name: Names.via(robot, @service)]
    running = Supervisor.child_spec({DynamicSupervisor, options}, shutdown: @end_all_ms)
    Supervisor.init([running, {Responder, {robot, answers}}], strategy: :rest_for_one)
  end

  @impl Responder
  def init(robot, catalogue), do: %{robot: robot, catalogue: catalogue}

  @impl Responder
  def handle(%{performative: :query, content: :programs}, s) do
    programs = for {name, _module} <- s.catalogue, do: {Atom.to_string(name), pid(s, name) != nil}
    {{:inform, programs}, s}
  end

  def handle(%{performative: :request, content: {what, name, giver}}, s)
      when what in [:start, :end] and is_binary(name) do
    with {:ok, program} <- program(s, name),
         :ok <- carry_out(what, program, s) do
      told(what, name, giver, s)
      {{:inform, name}, s}
    else
      {:error, line} -> {{:refuse, line}, s}
    end
  end

  def handle(_other, s), do: {{:refuse, "expected a program to start or to end"}, s}

  # A name becomes a program by comparison, never an atom.
  defp program(%{catalogue: catalogue, robot: robot}, name) do
    case Enum.find(catalogue, fn {known, _module} -> Atom.to_string(known) == name end) do
      nil ->
        names = for {known, _module} <- catalogue, do: Atom.to_string(known)
        hint = Options.Suggest.hint(name, names)

        {:error,
         "#{robot} has no program #{Options.Wording.show(name)}; it has #{Enum.join(names, ", ")}#{hint}"}

      program ->
        {:ok, program}
    end
  end

  defp carry_out(:start, {name, module}, s) do
    {module, argument} = if is_tuple(module), do: module, else: {module, nil}
    spec = Responder.child_spec({s.robot, service: name, module: module, argument: argument})

    case DynamicSupervisor.start_child(
           Names.via(s.robot, @service),
           Map.merge(spec, %{restart: :temporary, shutdown: @end_ms})
         ) do
      {:ok, _pid} -> :ok
      {:error, {:already_started, _pid}} -> {:error, "#{name} runs on #{s.robot} already"}
      {:error, reason} -> {:error, "#{name} does not start on #{s.robot}: #{why(reason)}"}
    end
  end

  defp carry_out(:end, {name, _module}, s) do
    with pid when is_pid(pid) <- pid(s, name),
         :ok <- DynamicSupervisor.terminate_child(Names.via(s.robot, @service), pid) do
      :ok
    else
      nil -> {:error, "#{name} does not run on #{s.robot}"}
      {:error, :not_found} -> {:error, "#{name} is part of #{s.robot}, and ends with it"}
    end
  end

  defp pid(%{robot: robot}, name), do: Names.whereis(robot, {:service, name})

  defp why({%{__exception__: true} = error, _stack}), do: Exception.message(error)
  defp why(reason), do: inspect(reason, limit: 5, printable_limit: 60)

  defp told(what, name, giver, s) do
    by = Giver.text(giver) || "another program"
    about = %{robot: s.robot, order: "program #{what} #{name}", by: by}
    Event.execute([:swarm, :comms, :ordered], %{}, about)
  end
end
