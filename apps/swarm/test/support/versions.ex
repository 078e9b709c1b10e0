defmodule Swarm.Versions do
  @moduledoc """
  Versions of a mission that no file of the build holds, as object code, for tests that replace code. Each says its
  version and lets the robot roll. Of the kinds, `:crash` and `:push` raise 1.3 s after the start, `:push` in a behaviour of its
  own, `:init` at once, and `:hang` never returns.

  A version is loaded while it is compiled: no robot of this node may run the mission meanwhile.
  """

  @doc "The object code of a version of this module, which is not loaded afterwards."
  @spec code(module(), version :: pos_integer(), kind :: atom()) :: [{module(), binary()}]
  def code(module, version, kind \\ :good) do
    false = :erlang.module_loaded(module)
    code = module |> source(version, kind) |> Code.compile_string()

    for {compiled, _beam} <- code do
      :code.delete(compiled)
      :code.purge(compiled)
    end

    code
  end

  defp source(module, version, kind) do
    """
    defmodule #{inspect(module)} do
      @behaviour Robot.Mission

      def option_table, do: [speed: [{:number, 0.05, 0.5, "m/s"}, default: 0.2]]
      def commands, do: []
      def init(_robot, options), do: #{init(kind)}
      def handle({:command, :start}, mission), do: roll(%{mission | on: true})
      def handle({:tick, _}, %{on: true} = mission), do: roll(%{mission | ticks: mission.ticks + 1})
      def handle(_event, mission), do: {if(mission.on, do: :roll, else: :idle), mission, []}

      defp roll(mission) do
        #{if kind == :crash, do: "if mission.ticks > 12, do: raise(\"version #{version} is wrong\")"}
        claim = %{phase: :roll, says: "version #{version}"}
        {:roll, mission, [{:claim, claim}, {:goal, :roll, #{goal(kind)}}]}
      end
    end
    #{if kind == :push, do: push(module)}
    """
  end

  defp init(:init), do: ~s[raise("no state for " <> inspect(options))]
  defp init(:hang), do: "Process.sleep(:infinity) && options"
  defp init(_kind), do: "{:idle, %{on: false, ticks: 0, speed: options[:speed]}, []}"

  defp goal(:push), do: "{__MODULE__.Push, speed: mission.speed}"
  defp goal(_kind), do: "{Robot.Behaviour.Move, linear: mission.speed, turn: 0.0}"

  defp push(module) do
    """
    defmodule #{inspect(module)}.Push do
      @behaviour Robot.Behaviour
      def new(options), do: {__MODULE__, {options[:speed], 0}}
      def update(_options, state), do: {__MODULE__, state}
      def tick(_percept, {_speed, n}) when n > 12, do: raise("pushed too far")

      def tick(_percept, {speed, n}) do
        wish = Robot.Wish.new(:push, Hal.Twist.new(speed, 0.0), 0.5)
        {:running, wish, {__MODULE__, {speed, n + 1}}}
      end
    end
    """
  end
end
