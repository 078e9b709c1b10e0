defmodule Swarm.UnfitMission do
  @moduledoc """
  A mission that lets the robot roll, or is not fit for it, for tests that replace missions. With `does:` `:crash` or `:push` it
  raises 1.3 s after the start, with `:push` in a behaviour; with `:init` at once; with `:hang` its `init/2` never returns.
  """
  @behaviour Robot.Mission

  defmodule Push do
    @moduledoc "A behaviour that raises after 1.3 s."
    @behaviour Robot.Behaviour

    @impl Robot.Behaviour
    def new(options), do: {__MODULE__, {options[:speed], 0}}

    @impl Robot.Behaviour
    def update(_options, state), do: {__MODULE__, state}

    @impl Robot.Behaviour
    def tick(_percept, {_speed, n}) when n > 12, do: raise("pushed too far")

    def tick(_percept, {speed, n}) do
      wish = Robot.Wish.new(:push, Hal.Twist.new(speed, 0.0), 0.5)
      {:running, wish, {__MODULE__, {speed, n + 1}}}
    end
  end

  @impl Robot.Mission
  def option_table do
    [
      speed: [{:number, 0.05, 0.5, "m/s"}, default: 0.2],
      does: [{:one_of, [:roll, :crash, :push, :init, :hang]}, default: :roll]
    ]
  end

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def init(_robot, options) do
    case options[:does] do
      :init -> raise "no state for #{inspect(options)}"
      :hang -> receive(do: (:never -> {:idle, nil, []}))
      does -> {:idle, %{on: false, ticks: 0, does: does, speed: options[:speed]}, []}
    end
  end

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: roll(%{mission | on: true})

  def handle({:tick, _percept}, %{on: true, does: :crash, ticks: ticks}) when ticks > 12,
    do: raise("it is wrong")

  def handle({:tick, _percept}, %{on: true} = mission),
    do: roll(%{mission | ticks: mission.ticks + 1})

  def handle(_event, mission), do: {if(mission.on, do: :roll, else: :idle), mission, []}

  defp roll(mission),
    do: {:roll, mission, [{:claim, %{phase: :roll}}, {:goal, :roll, goal(mission)}]}

  defp goal(%{does: :push, speed: speed}), do: {Push, speed: speed}
  defp goal(%{speed: speed}), do: {Robot.Behaviour.Move, linear: speed, turn: 0.0}
end
