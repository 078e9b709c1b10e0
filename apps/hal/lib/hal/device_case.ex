defmodule Hal.DeviceCase do
  @moduledoc false
  # What the kits for drivers share (`Hal.DriveCase`, `Hal.ScanCase`, `Hal.CameraCase`, `Hal.PtzCase`): a device and the
  # emulated other end of its line for the time of one rule, what is heard of it, and the rules that hold for devices of
  # any kind.
  alias Hal.{Clock, Device, Options}

  @noise 40
  @chunk 500
  @hold_ms 500
  @look_ms 20

  @first [:options, :missing]
  @last [:junk, :messages, :unplug, :restart, :program, :close, :killed]

  @enforce_keys [:kind, :driver, :emulated, :options]
  defstruct @enforce_keys ++ [link: nil, ref: nil, pid: nil, device: nil]

  @typedoc """
  One run of a rule, this struct or that of a kit which has more. A driver's options may be a function of the link; those in a list get it as
  `port:`. `options` are those of the kit, among them `only`, `wait_ms`, `bytes` and `seed`; `ref` marks what is heard, `pid` is
  the emulated device.
  """
  @type t :: %{
          required(:kind) => Device.kind(),
          required(:driver) => {module(), keyword() | (String.t() -> keyword())},
          required(:emulated) => {module(), keyword()},
          required(:options) => keyword(),
          required(:link) => String.t() | nil,
          required(:ref) => reference() | nil,
          required(:pid) => pid() | nil,
          required(:device) => pid() | nil,
          optional(atom()) => term()
        }
  @type result :: :ok | {:ok, term()} | {:error, line :: String.t()}
  @typedoc """
  Whether the device does its work now. The number differs between two calls of a rule, so that what is seen may, too; the
  words say when this is, for the line.
  """
  @type works :: (t(), pos_integer(), String.t() -> :ok | {:error, String.t()})

  @doc "All rules of a kit that has these of its own."
  @spec rules([atom()]) :: [atom()]
  def rules(own), do: @first ++ own ++ @last

  @doc "The options that all kits have; so many bytes may a device's state have unless told otherwise."
  @spec table([atom()], pos_integer()) :: Options.table()
  def table(rules, bytes) do
    [
      only: [{:list, {:one_of, rules}}, default: rules],
      wait_ms: [{:integer, 1_000, 600_000, "ms"}, default: 20_000],
      bytes: [{:integer, 1, 1_000_000_000, "bytes"}, default: bytes],
      seed: [:integer, default: 1]
    ]
  end

  @doc "What does not hold of the rules that are asked for, one line each."
  @spec problems(t(), (rule :: atom(), t() -> result())) :: [String.t()]
  def problems(t, judge) do
    for rule <- t.options[:only],
        {:error, line} <- [within_folder(t, &judge.(rule, &1))],
        do: "#{rule}: #{line}"
  end

  @doc "Judges one of the rules that devices of all kinds share."
  @spec rule(atom(), t(), works()) :: result()
  def rule(:options, t, _works), do: refuses(t)

  def rule(:missing, t, works) do
    with_device(t, [], fn t ->
      with {:ok, reason} <- await(t, "is not offline, and has nothing to open", &offline/1),
           :ok <- one_line(words(t, reason), t.link),
           do: with_emulated(t, &works.(&1, 1, "once it is there"))
    end)
  end

  def rule(:messages, t, works) do
    on_emulated(t, [], fn t ->
      for junk <- [:junk, {:junk, 1}, {make_ref(), {:data, "junk"}}, nil],
          do: send(t.device, junk)

      with :ok <- works.(t, 1, "after messages that it does not know"),
           do: alive(t, "messages that it does not know")
    end)
  end

  def rule(:junk, t, works) do
    on_emulated(t, [], fn t ->
      with :ok <- works.(t, 1, "before noise") do
        seed = :rand.seed_s(:exsss, t.options[:seed])
        Enum.reduce(1..@noise, seed, fn _chunk, rand -> noise(t, @chunk, rand) end)
        with :ok <- works.(t, 2, "after noise"), :ok <- alive(t, "noise"), do: small(t)
      end
    end)
  end

  def rule(:unplug, t, works) do
    on_emulated(t, [], fn t ->
      with :ok <- works.(t, 1, "before its cable is pulled"),
           :ok <- tell(t, :unplug),
           {:ok, _reason} <- await(t, "is not offline, and has no cable", &offline/1),
           :ok <- tell(t, :plug),
           do: works.(t, 2, "with its cable back")
    end)
  end

  def rule(:restart, t, works) do
    on_emulated(t, [], fn t ->
      with :ok <- works.(t, 1, "before it is switched off"),
           :ok <- tell(t, :restart),
           :ok <- works.(t, 2, "after it is switched on"),
           do: alive(t, "being switched off and on")
    end)
  end

  def rule(:program, t, works) do
    on_emulated(t, [], fn t ->
      with :ok <- works.(t, 1, "before its port program is killed") do
        t |> programs() |> kill()
        works.(t, 2, "after its port program was killed")
      end
    end)
  end

  def rule(:close, t, works), do: ended(t, works, :shutdown, "the end of its device")
  def rule(:killed, t, works), do: ended(t, works, :kill, "the killing of its process")

  defp ended(t, works, reason, what) do
    on_emulated(t, [], fn t ->
      with :ok <- works.(t, 1, "before #{what}") do
        programs = t |> programs() |> Enum.flat_map(&family/1)
        close(t.device, reason)
        flush(t.ref)
        with :ok <- gone(programs, what, Clock.now_ms() + t.options[:wait_ms]), do: mute(t, what)
      end
    end)
  end

  defp mute(%{ref: ref}, what) do
    receive do
      {^ref, _reading} -> {:error, "still says something after #{what}"}
    after
      @hold_ms -> :ok
    end
  end

  # A program and those that it has started, which Linux tells.
  defp family(pid) do
    case File.read("/proc/#{pid}/task/#{pid}/children") do
      {:ok, children} -> [pid | children |> String.split() |> Enum.flat_map(&family/1)]
      {:error, _reason} -> [pid]
    end
  end

  defp gone(programs, what, until_ms) do
    case Enum.filter(programs, &running?/1) do
      [] ->
        :ok

      [program | _others] = left ->
        if Clock.now_ms() >= until_ms do
          {:error, "its program #{program} runs on after #{what}"}
        else
          receive do
          after
            @look_ms -> gone(left, what, until_ms)
          end
        end
    end
  end

  # One that has ended may still have its entry in the table.
  defp running?(program) do
    case File.read("/proc/#{program}/stat") do
      {:ok, stat} -> not (stat =~ ~r/\) Z /)
      {:error, _reason} -> false
    end
  end

  @doc "Whether the driver refuses an option that it does not know."
  @spec refuses(t()) :: result()
  def refuses(t) do
    {driver, options} = driver(t)

    with {:ok, state} <- driver.init([no_such_option: 1] ++ options), do: driver.terminate(state)
    {:error, "no_such_option: 1 is not refused by its init/1 (`ArgumentError`)"}
  rescue
    refused in ArgumentError -> one_line(Exception.message(refused), "no_such_option")
  end

  @doc "Runs with an emulated device and its driver; the options are those of `Hal.Device`, beside those of the kit."
  @spec on_emulated(t(), keyword(), (t() -> result())) :: result()
  def on_emulated(t, options, rule), do: with_emulated(t, &with_device(&1, options, rule))

  defp within_folder(t, rule) do
    name = "#{t.kind}_case_#{System.pid()}_#{System.unique_integer([:positive])}"
    folder = Path.join(System.tmp_dir!(), name)
    File.mkdir_p!(folder)

    try do
      rule.(%{t | link: Path.join(folder, "line"), ref: make_ref()})
    after
      File.rm_rf!(folder)
    end
  end

  defp with_emulated(%{emulated: {emulated, options}} = t, rule) do
    case emulated.start_link([link: t.link] ++ options) do
      {:ok, pid} ->
        try do
          rule.(%{t | pid: pid})
        after
          Process.unlink(pid)
          GenServer.stop(pid)
        end

      {:error, line} ->
        {:error, "its other end does not start: #{inspect(line)}"}
    end
  end

  @doc "Runs with a device alone; the options are those of `Hal.Device`, beside those of the kit."
  @spec with_device(t(), keyword(), (t() -> result())) :: result()
  def with_device(t, options, rule) do
    sinks = [{__MODULE__, :hear, [self(), t.ref]}]
    options = Keyword.merge([kind: t.kind, driver: driver(t), sinks: sinks], options)
    {:ok, device} = Device.start_link(options)
    # A driver that crashes is a problem, not the end of the kit.
    Process.unlink(device)

    try do
      rule.(%{t | device: device})
    after
      close(device)
      flush(t.ref)
    end
  end

  @doc "The driver with its options."
  @spec driver(t()) :: {module(), keyword()}
  def driver(%{driver: {driver, options}, link: link}) when is_function(options, 1),
    do: {driver, options.(link)}

  def driver(%{driver: {driver, options}, link: link}), do: {driver, [port: link] ++ options}

  @doc "Calls a function of the emulated device."
  @spec tell(t(), atom(), list()) :: term()
  def tell(%{emulated: {emulated, _options}} = t, function, arguments \\ []),
    do: apply(emulated, function, [t.pid | arguments])

  @doc "Ends a device, by default as its supervisor does; it may have ended before."
  @spec close(pid(), :shutdown | :kill) :: :ok
  def close(device, reason \\ :shutdown) do
    ref = Process.monitor(device)
    Process.exit(device, reason)
    receive do: ({:DOWN, ^ref, :process, _pid, _reason} -> :ok)
  end

  @doc false
  def hear(pid, ref, reading), do: send(pid, {ref, reading})

  defp flush(ref) do
    receive do
      {^ref, _reading} -> flush(ref)
    after
      0 -> :ok
    end
  end

  @doc "Waits for a reading of which `wanted` makes something; the error is this line."
  @spec await(t(), String.t(), (reading :: term() -> found | nil)) ::
          {:ok, found} | {:error, String.t()}
        when found: term()
  def await(t, line, wanted), do: await(t, line, wanted, Clock.now_ms() + t.options[:wait_ms])

  defp await(%{ref: ref} = t, line, wanted, until_ms) do
    receive do
      {^ref, reading} ->
        case wanted.(reading) do
          nil -> await(t, line, wanted, until_ms)
          found -> {:ok, found}
        end
    after
      max(until_ms - Clock.now_ms(), 0) -> {:error, line}
    end
  end

  defp offline({:health, _device, {{:offline, reason}, _since_ms}}), do: reason
  defp offline(_other), do: nil

  @doc "Puts so many bytes of noise on the line."
  @spec noise(t(), pos_integer(), :rand.state()) :: :rand.state()
  def noise(t, size, rand) do
    {bytes, rand} = :rand.bytes_s(size, rand)
    :ok = tell(t, :noise, [bytes])
    rand
  end

  @doc "Whether the device's process lives."
  @spec alive(t(), String.t()) :: :ok | {:error, String.t()}
  def alive(t, after_what),
    do: if(Process.alive?(t.device), do: :ok, else: {:error, "ends after #{after_what}"})

  @doc "Whether its state is within the bytes that are allowed; binaries count, too."
  @spec small(t()) :: :ok | {:error, String.t()}
  def small(t) do
    size = t.device |> :sys.get_state() |> :erlang.external_size()

    if size > t.options[:bytes],
      do: {:error, "its state has #{size} bytes after noise"},
      else: :ok
  end

  @doc "The programs of the device's ports."
  @spec programs(t()) :: [non_neg_integer()]
  def programs(t) do
    {:links, links} = Process.info(t.device, :links)
    for port <- links, is_port(port), {:os_pid, pid} <- [Port.info(port, :os_pid)], do: pid
  end

  @doc "Kills programs."
  @spec kill([non_neg_integer()]) :: :ok
  def kill(programs) do
    for program <- programs, do: {_out, 0} = System.cmd("kill", ["-KILL", "#{program}"])
    :ok
  end

  @doc "A reason to be offline, in the driver's words."
  @spec words(t(), reason :: term()) :: String.t()
  def words(t, reason) do
    {driver, options} = driver(t)

    if function_exported?(driver, :explain, 2),
      do: driver.explain(reason, options),
      else: "#{inspect(reason)}, because it has no explain/2"
  end

  @doc "Whether it is one line, and names this."
  @spec one_line(String.t(), String.t()) :: :ok | {:error, String.t()}
  def one_line(line, named) do
    if String.contains?(line, "\n") or not String.contains?(line, named),
      do: {:error, "expected one line that names #{named}, got #{inspect(line)}"},
      else: :ok
  end
end
