defmodule Console.Metrics do
  @moduledoc """
  Writes what is known of a fleet as Prometheus reads it, in its text format 0.0.4. Pure, but for `node/0`.

  What a robot does not say has no line: a sigma of a robot that does not know its place, counters of one that is known by its
  row alone. A robot that was heard once is `convoy_up 0` when it is heard no more.
  """
  alias Swarm.Status

  # The radius within which a robot is in 95 of 100 cases is so many standard deviations (two dimensions, chi-square 5.991).
  @sigmas 2.4477

  @typedoc "What the node that is asked knows of itself: datagrams that it refused, by reason."
  @type about_node :: %{name: String.t(), refused: %{atom() => non_neg_integer()}}

  # Name, kind, help, and the samples of a robot: `{labels, value}`.
  @metrics [
    {"convoy_up", :gauge, "Whether the robot is heard, and answers."},
    {"convoy_armed", :gauge, "Whether its wheels may turn."},
    {"convoy_estopped", :gauge, "Whether an emergency stop holds it."},
    {"convoy_leader", :gauge, "Whether it leads."},
    {"convoy_fault", :gauge,
     "Whether it stands by itself, because of a fault, a crash or what hangs."},
    {"convoy_device_online", :gauge, "Whether a device of it works."},
    {"convoy_pose_sigma_metres", :gauge, "Standard deviation of its estimate of its place."},
    {"convoy_battery_volts", :gauge, "Voltage of its battery."},
    {"convoy_speed_metres_per_second", :gauge, "What its wheels report."},
    {"convoy_heartbeat_age_seconds", :gauge, "Age of the newest report of its wheels."},
    {"convoy_distance_metres_total", :counter, "How far its wheels have driven."},
    {"convoy_stops_total", :counter, "Stops by its gate, by reason."},
    {"convoy_process_restarts_total", :counter, "Restarts of a part of its program."},
    {"convoy_tick_late_seconds", :histogram, "How late its decisions come, of ten a second."}
  ]

  @doc "The type of the text."
  @spec content_type() :: String.t()
  def content_type, do: "text/plain; version=0.0.4; charset=utf-8"

  @doc "What this node knows of itself."
  @spec node() :: about_node()
  def node do
    refused = if Mesh.running?(), do: Mesh.rejected(), else: %{}
    %{name: Atom.to_string(Kernel.node()), refused: refused}
  end

  @doc """
  The text of robots that were ever heard, with the statuses of those that are.

      iex> text = Console.Metrics.text([:mag1, :mag2], [%Swarm.Status{robot: :mag1, arming: :armed, uncertainty: 0.24}], %{name: "base", refused: %{}})
      iex> text |> String.split("\\n") |> Enum.reject(&String.starts_with?(&1, "#")) |> Enum.take(4)
      ["convoy_up{robot=\\"mag1\\"} 1", "convoy_up{robot=\\"mag2\\"} 0", "convoy_armed{robot=\\"mag1\\"} 1", "convoy_estopped{robot=\\"mag1\\"} 0"]
  """
  @spec text([atom()], [Status.t()], about_node()) :: String.t()
  def text(robots, statuses, about_node) do
    heard = Map.new(statuses, &{&1.robot, &1})
    robots = robots |> Enum.concat(Map.keys(heard)) |> Enum.uniq() |> Enum.sort()

    of_robots =
      for {name, kind, help} <- @metrics,
          samples = Enum.flat_map(robots, &samples(name, &1, heard[&1])),
          samples != [],
          do: [head(name, kind, help) | samples]

    refused =
      for {why, count} <- Enum.sort(about_node.refused),
          do: line("convoy_datagrams_refused_total", [node: about_node.name, why: why], count)

    help = "Datagrams that this node has refused, by reason."

    of_node =
      if refused == [],
        do: [],
        else: [head("convoy_datagrams_refused_total", :counter, help) | refused]

    IO.iodata_to_binary([of_robots, of_node])
  end

  defp head(name, kind, help), do: "# HELP #{name} #{help}\n# TYPE #{name} #{kind}\n"

  defp samples("convoy_up" = name, robot, status) do
    up? = status != nil and status.state not in [:no_answer, :not_heard] and status.from == :robot
    [line(name, [robot: robot], flag(up?))]
  end

  defp samples(_name, _robot, nil), do: []

  defp samples("convoy_device_online" = name, robot, status) do
    for {device, health} <- Enum.sort(status.health),
        do: line(name, [robot: robot, device: device], flag(health == :online))
  end

  defp samples("convoy_stops_total" = name, robot, %{meters: %{stops: stops}}),
    do:
      for(
        {reason, count} <- Enum.sort(stops),
        do: line(name, [robot: robot, reason: reason], count)
      )

  defp samples("convoy_process_restarts_total" = name, robot, %{meters: %{restarts: restarts}}),
    do:
      for(
        {part, count} <- Enum.sort(restarts),
        do: line(name, [robot: robot, process: part], count)
      )

  defp samples("convoy_tick_late_seconds", _robot, %{meters: %{ticks: 0}}), do: []

  defp samples("convoy_tick_late_seconds" = name, robot, %{meters: %{late_s: late} = meters}) do
    buckets =
      for {bound, count} <- late ++ [{"+Inf", meters.ticks}],
          do: line(name <> "_bucket", [robot: robot, le: bound], count)

    sum = line(name <> "_sum", [robot: robot], meters.late_sum_s)
    buckets ++ [sum, line(name <> "_count", [robot: robot], meters.ticks)]
  end

  defp samples(name, robot, status) do
    case value(name, status) do
      nil -> []
      value -> [line(name, [robot: robot], value)]
    end
  end

  defp value("convoy_armed", %{arming: nil}), do: nil
  defp value("convoy_armed", %{arming: arming}), do: flag(arming == :armed)
  defp value("convoy_estopped", status), do: flag(status.estop)
  defp value("convoy_leader", status), do: flag(status.leader == status.robot)

  defp value("convoy_fault", status),
    do: flag(status.fault != nil or status.crashed != nil or status.hung != nil)

  defp value("convoy_pose_sigma_metres", %{uncertainty: radius}), do: radius && radius / @sigmas
  defp value("convoy_battery_volts", %{power: volts}), do: volts
  defp value("convoy_speed_metres_per_second", %{speed: speed}), do: speed
  defp value("convoy_heartbeat_age_seconds", %{age_ms: age_ms}), do: age_ms && age_ms / 1_000
  defp value("convoy_distance_metres_total", %{meters: %{distance_m: metres}}), do: metres
  defp value(_counter, _row), do: nil

  defp flag(true), do: 1
  defp flag(_no), do: 0

  defp line(name, labels, value) do
    labels =
      Enum.map_join(labels, ",", fn {key, label} -> ~s(#{key}="#{escaped("#{label}")}") end)

    "#{name}{#{labels}} #{value}\n"
  end

  defp escaped(text),
    do:
      text
      |> String.replace("\\", "\\\\")
      |> String.replace("\"", "\\\"")
      |> String.replace("\n", "\\n")
end
