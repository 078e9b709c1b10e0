defmodule Gather.DeskBase do
  @moduledoc """
  A base without wheels, which does at once what it is told and reports so: to try a robot's file on a desk. Option:
  `period` of its reports (milliseconds, default 100).
  """
  @behaviour Hal.Drive
  alias Hal.{Odometry, Options, Pose, Twist}

  @table [period: [{:integer, 20, 400, "ms"}, default: 100]]

  @impl Hal.Drive
  def option_table, do: @table

  @impl Hal.Drive
  def init(options) do
    options = Options.check!(options, @table, "desk base")
    {:ok, timer} = :timer.send_interval(options[:period], :report)
    state = %{timer: timer, period_s: options[:period] / 1_000, frame: make_ref()}
    {:ok, Map.merge(state, %{pose: Pose.new(0, 0), twist: Twist.zero()})}
  end

  @impl Hal.Drive
  def drive(%Twist{} = twist, state), do: {:ok, %{state | twist: twist}}

  @impl Hal.Drive
  def handle_message(:report, %{twist: twist, period_s: seconds} = state) do
    step = Pose.new(twist.linear * seconds, 0, twist.turn * seconds)
    pose = Pose.compose(state.pose, step)

    {:ok, [{:odometry, %Odometry{pose: pose, twist: twist, frame: state.frame}}],
     %{state | pose: pose}}
  end

  def handle_message(_unknown, state), do: {:ok, [], state}

  @impl Hal.Drive
  def terminate(state) do
    {:ok, :cancel} = :timer.cancel(state.timer)
    :ok
  end
end
