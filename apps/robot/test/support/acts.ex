defmodule Robot.Acts do
  @moduledoc "A behaviour, a mission and a companion that do what a test tells them."

  defmodule Roll do
    @moduledoc "Wishes `:twist` until told to `:raise`; or ends with `:outcome`."
    @behaviour Robot.Behaviour
    alias Robot.Wish

    @impl Robot.Behaviour
    def new(options), do: {__MODULE__, Map.new(options)}

    @impl Robot.Behaviour
    def update(options, state), do: {__MODULE__, Map.merge(state, Map.new(options))}

    @impl Robot.Behaviour
    def tick(_percept, %{raise: line}), do: raise(line)
    def tick(_percept, %{outcome: outcome, twist: twist}), do: {:done, outcome, wish(twist)}
    def tick(_percept, %{twist: twist} = state), do: {:running, wish(twist), {__MODULE__, state}}

    defp wish(twist), do: %{Wish.new(:roll, twist, 0.9) | look: 0.25}
  end

  defmodule Hang do
    @moduledoc "Its first tick never ends; `:test` is told who hangs in it."
    @behaviour Robot.Behaviour

    @impl Robot.Behaviour
    def new(options), do: {__MODULE__, Map.new(options)}

    @impl Robot.Behaviour
    def tick(percept, %{test: test} = state) do
      send(test, {:hangs, self()})
      spin(percept, state)
    end

    # Busy, and not waiting: nothing that is sent to it is looked at.
    defp spin(percept, state), do: spin(percept, state)
  end

  defmodule Mission do
    @moduledoc """
    Starts with the effects `:effects`; the command `{:do, phase, effects}` brings others, and
    `:raise` raises, and `:hang` never returns, which `:test` is told, too. Tells `:test` all that it hears.
    """
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(robot, options) do
      tell(options, {:init, robot})
      {:ready, options, Keyword.get(options, :effects, [])}
    end

    @impl Robot.Mission
    def handle({:command, {:do, phase, effects}}, options), do: {phase, options, effects}
    def handle({:command, :raise}, _options), do: raise("the mission was told to")

    def handle({:command, :hang} = event, options) do
      tell(options, {:hangs, self()})
      spin(event)
    end

    def handle(event, options) do
      tell(options, event)
      {options[:phase] || :ready, options, []}
    end

    # What is left of it stands in the phase `:halted`; without one nothing is.
    @impl Robot.Mission
    def halted(options),
      do: if(options[:halted], do: Keyword.put(options, :phase, options[:halted]))

    defp spin(event), do: spin(event)

    defp tell(options, what), do: if(options[:test], do: send(options[:test], {:mission, what}))
  end

  defmodule Companion do
    @moduledoc "Tells `:test` that it was started."
    @behaviour Robot.Companion
    use GenServer

    @impl Robot.Companion
    def child_spec({config, options}) do
      %{id: __MODULE__, start: {GenServer, :start_link, [__MODULE__, {config, options}]}}
    end

    @impl GenServer
    def init({config, options}) do
      send(options[:test], {:companion, config.id, self()})
      {:ok, options}
    end
  end
end
