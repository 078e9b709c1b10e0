defmodule Hal.ScanCase do
  @moduledoc """
  Runs the driver of any lidar at one that is emulated, and says what does not hold that must hold for all. For tests:

      @tag timeout: 300_000
      test "what holds for every lidar" do
        assert Hal.ScanCase.problems({Hal.Lds.Driver, model: :lds02}, {Sim.Emulator, core: {Sim.Emulator.Lds, model: :lds02}}) == []
      end

  `Hal.Device` runs the driver, as in a robot, with the lidar's line as its option `port:`; the lidar is a `Hal.Emulated` with the
  callback below, such as `Sim.Emulator`. Each rule is a run of its own, in real time.

  | rule | must hold |
  |---|---|
  | `:options` | an option that it does not know is refused in one line that names it |
  | `:missing` | a port that is not there is an error, and in words one line that names it |
  | `:sees` | what is near in one direction is there in its scans, to 5 cm and 2 degrees, and nothing where nothing is |
  | `:turned` | the same to the left as to the right: no scan is mirrored |
  | `:junk` | noise on the line neither ends it nor makes its state grow, and it sees on |
  | `:messages` | nor do messages that it does not know |
  | `:unplug` | a pulled cable is an error, and once it is back it sees again |
  | `:restart` | a lidar that is switched off and on is found again |
  | `:program` | so is one whose port program was killed |
  """
  alias Hal.{Device, Options, Scan}

  @doc "What the lidar has around it from now on."
  @callback see(GenServer.server(), Scan.t()) :: :ok

  @rules [:options, :missing, :sees, :turned, :junk, :messages, :unplug, :restart, :program]
  @table [
    only: [{:list, {:one_of, @rules}}, default: @rules],
    wait_ms: [{:integer, 1_000, 600_000, "ms"}, default: 20_000],
    bytes: [{:integer, 1, 1_000_000_000, "bytes"}, default: 300_000],
    seed: [:integer, default: 1]
  ]
  @degree :math.pi() / 180
  # What is seen is as far away as this (metres), and so wide to each side (degrees).
  @near 0.8
  @wide 5
  @exact 0.05
  @noise 40

  @enforce_keys [:driver, :lidar, :options]
  defstruct @enforce_keys ++ [link: nil, ref: nil, pid: nil, device: nil]

  @doc """
  What does not hold, one line each. Options: `only` (these rules), `wait_ms` (how long a busy machine may take for what must come,
  20,000), `bytes` (how large the device's state may be, 300,000), `seed` (of the noise). Raises `ArgumentError` for options
  that are wrong.
  """
  @spec problems(driver :: {module(), keyword()}, lidar :: {module(), keyword()}, keyword()) ::
          [String.t()]
  def problems({_, _} = driver, {_, _} = lidar, options \\ []) do
    options = Options.check!(options, @table, "scan case")
    t = %__MODULE__{driver: driver, lidar: lidar, options: options}

    for rule <- options[:only],
        {:error, line} <- [within_folder(t, &rule(rule, &1))],
        do: "#{rule}: #{line}"
  end

  defp rule(:options, %{driver: {driver, options}} = t) do
    case driver.init([port: t.link, no_such_option: 1] ++ options) do
      {:ok, state} -> driver.terminate(state)
      {:error, _reason} -> :ok
    end

    {:error, "no_such_option: 1 is not refused by its init/1 (`ArgumentError`)"}
  rescue
    refused in ArgumentError -> one_line(Exception.message(refused), "no_such_option")
  end

  defp rule(:missing, t) do
    with_device(t, fn t ->
      with {:ok, reason} <- await(t, "is not offline, and has no port", &offline/1),
           do: one_line(words(t, reason), t.link)
    end)
  end

  defp rule(:sees, t), do: on_lidar(t, &sees(&1, 0, "ahead"))

  defp rule(:turned, t) do
    on_lidar(t, fn t ->
      with :ok <- sees(t, 90, "to the left"), do: sees(t, -60, "to the right")
    end)
  end

  defp rule(:junk, t) do
    on_lidar(t, fn t ->
      noise(t, @noise, :rand.seed_s(:exsss, t.options[:seed]))
      with :ok <- sees(t, 30, "after noise"), :ok <- alive(t, "noise"), do: small(t)
    end)
  end

  defp rule(:messages, t) do
    on_lidar(t, fn t ->
      for junk <- [:junk, {:junk, 1}, {make_ref(), {:data, "junk"}}, nil],
          do: send(t.device, junk)

      with :ok <- sees(t, 30, "after messages"), do: alive(t, "messages that it does not know")
    end)
  end

  defp rule(:unplug, t) do
    on_lidar(t, fn %{lidar: {lidar, _options}} = t ->
      with :ok <- sees(t, 0, "before its cable is pulled"),
           :ok <- lidar.unplug(t.pid),
           {:ok, _reason} <- await(t, "is not offline, and has no cable", &offline/1),
           :ok <- lidar.plug(t.pid),
           do: sees(t, 120, "with its cable back")
    end)
  end

  defp rule(:restart, t) do
    on_lidar(t, fn %{lidar: {lidar, _options}} = t ->
      with :ok <- sees(t, 0, "before it is switched off"),
           :ok <- lidar.restart(t.pid),
           :ok <- sees(t, 120, "after it is switched on"),
           do: alive(t, "its lidar's restart")
    end)
  end

  defp rule(:program, t) do
    on_lidar(t, fn t ->
      with :ok <- sees(t, 0, "before its port program is killed") do
        {:links, links} = Process.info(t.device, :links)

        for port <- links,
            is_port(port),
            {:os_pid, pid} <- [Port.info(port, :os_pid)],
            do: {_out, 0} = System.cmd("kill", ["-KILL", "#{pid}"])

        sees(t, 120, "after its port program was killed")
      end
    end)
  end

  # Steps of the rules: `:ok`, or `{:error, line}`.

  defp on_lidar(%{lidar: {lidar, options}} = t, rule) do
    case lidar.start_link([link: t.link] ++ options) do
      {:ok, pid} ->
        try do
          with_device(%{t | pid: pid}, rule)
        after
          Process.unlink(pid)
          GenServer.stop(pid)
        end

      {:error, line} ->
        {:error, "its lidar does not start: #{inspect(line)}"}
    end
  end

  defp with_device(t, rule) do
    sinks = [{__MODULE__, :hear, [self(), t.ref]}]
    {driver, options} = t.driver
    driver = {driver, [port: t.link] ++ options}
    {:ok, device} = Device.start_link(kind: :scan, driver: driver, sinks: sinks)
    # A driver that crashes is a problem, not the end of the kit.
    Process.unlink(device)

    try do
      rule.(%{t | device: device})
    after
      ref = Process.monitor(device)
      Process.exit(device, :shutdown)
      receive do: ({:DOWN, ^ref, :process, _pid, _reason} -> :ok)
    end
  end

  defp within_folder(t, rule) do
    name = "scan_case_#{System.pid()}_#{System.unique_integer([:positive])}"
    folder = Path.join(System.tmp_dir!(), name)
    File.mkdir_p!(folder)

    try do
      rule.(%{t | link: Path.join(folder, "line"), ref: make_ref()})
    after
      File.rm_rf!(folder)
    end
  end

  @doc false
  def hear(pid, ref, reading), do: send(pid, {ref, reading})

  # Something near there, and nothing else within its reach.
  defp sees(%{lidar: {lidar, _options}} = t, degrees, where) do
    :ok = lidar.see(t.pid, around(degrees))

    with {:ok, _scan} <- await(t, "does not see what is #{where}", &seen(&1, degrees)), do: :ok
  end

  defp around(degrees) do
    rays =
      for k <- 0..359, into: <<>> do
        off = Integer.mod(k - degrees + 180, 360) - 180
        Scan.pack(if(abs(off) <= @wide, do: @near))
      end

    %Scan{start: 0.0, step: @degree, ranges: rays}
  end

  # All echoes are there, and most of those that should be.
  defp seen({:scan, scan}, degrees) do
    echoes = Scan.echoes(scan, 60.0)

    there =
      Enum.filter(echoes, fn {direction, range} ->
        off = Hal.Pose.wrap(direction - degrees * @degree)
        abs(off) <= (@wide + 2) * @degree and abs(range - @near) < @exact
      end)

    if there == echoes and length(there) >= @wide, do: {:ok, scan}
  end

  defp seen(_other, _degrees), do: nil

  defp offline({:health, _device, {{:offline, reason}, _since_ms}}), do: {:ok, reason}
  defp offline(_other), do: nil

  defp await(t, line, wanted),
    do: await(t, line, wanted, Hal.Clock.now_ms() + t.options[:wait_ms])

  defp await(%{ref: ref} = t, line, wanted, until_ms) do
    receive do
      {^ref, reading} -> wanted.(reading) || await(t, line, wanted, until_ms)
    after
      max(until_ms - Hal.Clock.now_ms(), 0) -> {:error, line}
    end
  end

  defp noise(_t, 0, _rand), do: :ok

  defp noise(%{lidar: {lidar, _options}} = t, times, rand) do
    {bytes, rand} = :rand.bytes_s(500, rand)
    :ok = lidar.noise(t.pid, bytes)
    noise(t, times - 1, rand)
  end

  defp alive(t, after_what),
    do: if(Process.alive?(t.device), do: :ok, else: {:error, "ends after #{after_what}"})

  # Binaries count, too.
  defp small(t) do
    size = t.device |> :sys.get_state() |> :erlang.external_size()

    if size > t.options[:bytes],
      do: {:error, "its state has #{size} bytes after noise"},
      else: :ok
  end

  defp words(%{driver: {driver, options}} = t, reason) do
    if function_exported?(driver, :explain, 2),
      do: driver.explain(reason, [port: t.link] ++ options),
      else: "#{inspect(reason)}, because it has no explain/2"
  end

  defp one_line(line, named) do
    if String.contains?(line, "\n") or not String.contains?(line, named),
      do: {:error, "expected one line that names #{named}, got #{inspect(line)}"},
      else: :ok
  end
end
