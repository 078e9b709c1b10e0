defmodule Agents.Responder do
  @moduledoc """
  Runs a program on a robot that answers envelopes: a service that others find by its name. It is a companion of the
  robot's pilot, so it starts and crashes with the robot.

      defmodule Battery do
        @behaviour Agents.Responder
        @impl Agents.Responder
        def init(robot, volts), do: %{robot: robot, volts: volts}

        @impl Agents.Responder
        def handle(%{performative: :query, content: :volts}, s), do: {{:inform, s.volts}, s}
        def handle(_other, s), do: {{:refuse, :unknown}, s}
      end

      companions: [{Agents.Responder, service: :power, module: Battery, argument: 11.8}]

  It is in the groups `{:service, name}`, of all that offer the service, and
  `{:service, name, robot}`, of this one. Options: `:service` and `:module`; `:argument` for the
  module's `init/2`; `:topics`, envelopes of which are handled too; `:limit` and `:template` of
  its inbox (`Agents.Inbox`).

  The module's code handles input from outside. If it raises, that envelope is answered by a
  `:failure`, the event `[:swarm, :responder, :failure]` reports it, and the state is kept:
  otherwise four bad envelopes within five seconds would end the robot.
  """
  use GenServer
  alias Hal.Event
  alias Robot.Names
  alias Agents.{Conversation, Envelope, Inbox}
  alias Swarm.Directory
  alias Swarm.Wire

  @behaviour Robot.Companion

  # A program that does not come up within this time does not start.
  @init_ms 10_000

  @type answer ::
          {Envelope.performative(), content :: term()}
          | {Envelope.performative(), content :: term(), options :: keyword()}

  @doc "Returns the first state."
  @callback init(robot :: atom(), argument :: term()) :: state :: term()

  @doc """
  Handles an envelope, of which all but the content is checked: returns what to answer, and the
  next state.
  """
  @callback handle(Envelope.t(), state :: term()) :: {answer() | :noreply, state :: term()}

  @doc """
  Handles a message that is not an envelope, from anywhere. Without this callback such messages
  count as rejected.
  """
  @callback info(message :: term(), state :: term()) :: state :: term()

  @optional_callbacks info: 2

  @impl Robot.Companion
  def child_spec({%Robot.Config{id: id}, options}), do: child_spec({id, options})

  def child_spec({name, options}) when is_atom(name),
    do: %{id: {__MODULE__, options[:service]}, start: {__MODULE__, :start_link, [name, options]}}

  @doc """
  Starts a responder for a robot, or for any other program with a name. `Robot.Names` must be
  running.
  """
  @spec start_link(name :: atom(), keyword()) :: GenServer.on_start()
  def start_link(name, options) do
    allowed = [:service, :module, argument: nil, topics: [], limit: 1_000, template: []]

    unless Keyword.keyword?(options),
      do: raise(ArgumentError, "a responder has options such as service: :power, module: Battery")

    options = Keyword.validate!(options, allowed)
    _would_be = Inbox.new(Keyword.take(options, [:limit, :template]))

    unless Wire.name?(name) and Wire.name?(options[:service]),
      do: raise(ArgumentError, "a responder needs a name and a :service, both atoms")

    unless is_list(options[:topics]) and not List.improper?(options[:topics]) and
             Enum.all?(options[:topics], &Envelope.topic?/1),
           do:
             raise(
               ArgumentError,
               "topics: expected atoms or text, got #{inspect(options[:topics])}"
             )

    unless responder?(options[:module]),
      do:
        raise(
          ArgumentError,
          "module: expected an Agents.Responder, got #{inspect(options[:module])}"
        )

    via = Names.via(name, {:service, options[:service]})
    GenServer.start_link(__MODULE__, {name, options}, name: via, timeout: @init_ms)
  end

  # The exports of a module are known only once it is loaded.
  defp responder?(module) do
    is_atom(module) and Code.ensure_loaded?(module) and function_exported?(module, :init, 2) and
      function_exported?(module, :handle, 2)
  end

  @doc "How many messages it has dropped, by reason, and how many envelopes wait."
  @spec counts(GenServer.server()) :: %{atom() => non_neg_integer()}
  def counts(responder), do: GenServer.call(responder, :counts)

  @impl GenServer
  def init({name, options}) do
    [service, module] = [options[:service], options[:module]]
    groups = for topic <- options[:topics], do: {:topic, topic}

    {:ok,
     %{
       name: name,
       service: service,
       module: module,
       info?: function_exported?(module, :info, 2),
       state: module.init(name, options[:argument]),
       inbox: Inbox.new(Keyword.take(options, [:limit, :template])),
       entry:
         Directory.Membership.enter([{:service, service}, {:service, service, name} | groups])
     }}
  end

  @impl GenServer
  def handle_call(:counts, _from, s), do: {:reply, Inbox.counts(s.inbox), s}
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info(message, s) do
    case Inbox.arrived(s.inbox, message) do
      {:handle, envelope, inbox} -> {:noreply, handle(envelope, %{s | inbox: inbox})}
      {:wait, inbox} -> {:noreply, enter(message, s, inbox)}
    end
  end

  # Envelopes are frequent, notifications of the directory and others are rare. So the inbox looks
  # first, and what it counted as rejected may be a notification.
  defp enter(%{__struct__: Envelope}, s, inbox), do: %{s | inbox: inbox}
  defp enter({Inbox, _turn}, s, inbox), do: %{s | inbox: inbox}

  defp enter(message, s, inbox) do
    case Directory.Membership.arrived(s.entry, message) do
      {:ok, entry} -> %{s | entry: entry}
      :other -> if s.info?, do: info(message, s), else: %{s | inbox: inbox}
    end
  end

  defp info(message, s) do
    %{s | state: s.module.info(message, s.state)}
  catch
    kind, reason -> failed(kind, reason, s)
  end

  # Foreign code runs with content from outside: whatever it does must not end the robot.
  defp handle(envelope, s) do
    case s.module.handle(envelope, s.state) do
      {:noreply, state} -> %{s | state: state}
      {answer, state} -> answer(answer, envelope, %{s | state: state})
    end
  catch
    kind, reason ->
      answer({:failure, :error}, envelope, failed(kind, reason, s))
  end

  defp failed(kind, reason, s) do
    failure = %{robot: s.name, service: s.service, kind: kind, reason: reason}
    Event.execute([:swarm, :responder, :failure], %{}, failure)
    s
  end

  defp answer({performative, content}, envelope, s),
    do: answer({performative, content, []}, envelope, s)

  defp answer({performative, content, options}, envelope, s) do
    answer = Envelope.reply(envelope, performative, s.name, content, options)
    Conversation.post(envelope.reply_to, answer)
    s
  end
end
