defmodule Console.MetricsTest do
  use ExUnit.Case, async: true
  doctest Console.Metrics
  alias Console.{FakeLive, FakeTrial, Metrics, Page, PageCase}
  alias Hal.Pose
  alias Robot.Meters

  @promtool System.find_executable("promtool")

  # A status with all that is measured.
  defp whole do
    meters = Meters.new()
    for late_ms <- [0, 3, 700], do: Meters.late(meters, late_ms)
    for role <- [:gate, :pilot, :pilot], do: Meters.began(meters, role)
    for reason <- [:bumper, :estop, :bumper], do: Meters.stopped(meters, reason)
    Meters.drove(meters, 1.25)

    %Swarm.Status{
      robot: :mag1,
      state: :lead,
      leader: :mag1,
      pose: Pose.new(1, 2),
      uncertainty: 0.24477,
      arming: :armed,
      estop: false,
      power: 25.5,
      speed: 0.25,
      age_ms: 40,
      health: %{drive: :online, camera: {:offline, :enoent}},
      meters: Meters.read(meters)
    }
  end

  @node %{name: "base@convoy", refused: %{unsigned: 3, stale: 1}}

  defp samples(text), do: text |> String.split("\n") |> Enum.reject(&(&1 =~ ~r/^(#|$)/))

  test "says all that is measured, with its labels" do
    samples = samples(Metrics.text([:mag1], [whole()], @node))

    for line <- [
          ~s(convoy_up{robot="mag1"} 1),
          ~s(convoy_armed{robot="mag1"} 1),
          ~s(convoy_leader{robot="mag1"} 1),
          ~s(convoy_device_online{robot="mag1",device="camera"} 0),
          ~s(convoy_battery_volts{robot="mag1"} 25.5),
          ~s(convoy_heartbeat_age_seconds{robot="mag1"} 0.04),
          ~s(convoy_distance_metres_total{robot="mag1"} 1.25),
          ~s(convoy_stops_total{robot="mag1",reason="bumper"} 2),
          ~s(convoy_process_restarts_total{robot="mag1",process="pilot"} 1),
          ~s(convoy_tick_late_seconds_bucket{robot="mag1",le="0.005"} 2),
          ~s(convoy_tick_late_seconds_bucket{robot="mag1",le="+Inf"} 3),
          ~s(convoy_tick_late_seconds_count{robot="mag1"} 3),
          ~s(convoy_datagrams_refused_total{node="base@convoy",why="unsigned"} 3)
        ],
        do: assert(line in samples)

    assert Enum.find(samples, &(&1 =~ "sigma")) =~ ~r/ 0\.(1|0999)\d*$/
  end

  test "what a robot does not say has no line, and one that is gone is down" do
    row = %Swarm.Status{robot: :mag1, from: :row, state: "follow"}
    samples = samples(Metrics.text([:mag1, :mag2], [row], %{@node | refused: %{}}))
    assert ~s(convoy_up{robot="mag1"} 0) in samples
    assert ~s(convoy_up{robot="mag2"} 0) in samples
    refute Enum.any?(samples, &(&1 =~ ~r/sigma|battery|_total|late|refused|armed/))
    refute Enum.any?(samples, &(&1 =~ ~r/mag2/ and not (&1 =~ "convoy_up")))
  end

  test "labels hold no quotes, whatever the names are" do
    status = %{whole() | health: %{"a\"b\\c\nd" => :online}}
    text = Metrics.text([:mag1], [status], @node)
    assert text =~ ~S(device="a\"b\\c\nd"} 1)
  end

  @tag :tmp_dir
  @tag skip: if(@promtool, do: false, else: "promtool is not installed (on Debian: prometheus)")
  test "Prometheus' own judge has nothing to say", %{tmp_dir: folder} do
    file = Path.join(folder, "metrics")
    File.write!(file, Metrics.text([:mag1, :mag2], [whole()], @node))
    judge = [~s(exec "$0" check metrics < "$1"), @promtool, file]
    assert System.cmd("sh", ["-c" | judge], stderr_to_stdout: true) == {"", 0}
  end

  @tag :realtime
  @tag skip: PageCase.no_server() || false
  test "the page's server has them, and says where it has none" do
    {:ok, _apps} = Application.ensure_all_started(:inets)
    {:ok, live} = FakeLive.start_link(FakeLive.of([{:mag1, {1.0, 2.0}, arming: :armed}]))
    {:ok, _page, url} = Page.start_link(module: FakeLive, live: live, robots: [:mag1, :mag2])
    assert {200, text} = get(url)
    assert ~s(convoy_up{robot="mag2"} 0) in samples(text)

    trial = %{module: FakeTrial, live: nil, robots: [:mag1]}
    {:ok, _page, url} = Page.start_link(Map.to_list(trial))
    assert {404, "metrics are of robots that are processes" <> _} = get(url)
  end

  defp get(url) do
    {:ok, {{_http, status, _}, _headers, body}} =
      :httpc.request(:get, {~c"#{url}metrics", []}, [ssl: []], body_format: :binary)

    {status, body}
  end
end
