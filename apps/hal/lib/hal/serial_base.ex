defmodule Hal.SerialBase do
  @moduledoc """
  Runs a base on a serial line whose protocol is a set of functions, as a `Hal.Drive`. A driver says

      use Hal.SerialBase, subject: "kobuki", speed: 115_200, limits: %{max_linear: 0.7, …}

  (the name in errors of its options, the line's speed in baud, and what its maker's sheet allows: m/s, rad/s, m/s2, rad/s2),
  and has the callbacks below. They are pure: time is passed in, in whole milliseconds, and what they return is sent.

  What a driver gets by it:

    * the options of the line and the limits, which never exceed the maker's and the body's (`Hal.SerialBase.Options`)
    * every speed passes `Hal.Drive.SlewLimiter`, the last step before the wire, at least every 50 ms. A stop is not ramped, and
      is sent at once. A value that is not a speed counts as a stop; so does an order that is older than 500 ms, and every order
      while the base is not ready
    * the line's last words, said twice, by the port program: when the VM is killed or frozen, and when the driver ends
      (`Hal.Serial`)
    * a base that says nothing that can be understood for 2 s (`silent_ms:` of these) is the error `:silent`
    * what it keeps when a lost line is opened again in the same process, such as its odometry (`Hal.SerialBase.Odometry`)
  """
  alias Hal.{Options, Profile, Serial, Twist}
  alias Hal.Drive.SlewLimiter

  @tick_ms 50
  @order_ms 500
  @silent_ms 2_000

  @typedoc "The protocol's own state."
  @type protocol :: term()
  @typedoc "All options of a driver, by their names; `limits` is a `Hal.Drive.SlewLimiter`."
  @type options :: %{atom() => term()}

  @doc "The options of this driver alone."
  @callback own_table() :: Options.table()

  @doc """
  The protocol of a line that has just been opened, and the bytes that it says first, among them a stop. `before` is what `c:keep/1`
  kept when the same line was lost, or `nil` in a new process.
  """
  @callback new(options(), before :: term() | nil, at_ms :: integer()) :: {iodata(), protocol()}

  @doc "Takes bytes from the line, and returns readings and what is said at once."
  @callback hear(protocol(), bytes :: binary(), at_ms :: integer()) ::
              {[Hal.Drive.reading()], iodata(), protocol()}

  @doc """
  Says the speed, every 50 ms and at once where it changes. It is within the limits. `fresh?` says whether an order is behind it, and
  not silence.
  """
  @callback say(protocol(), Twist.t(), fresh? :: boolean(), at_ms :: integer()) ::
              {iodata(), protocol()}

  @doc "What is kept for the next opening of the line: odometry that starts again at zero would be a jump."
  @callback keep(protocol()) :: term()

  @doc "Whether the wheels may turn; the error says in one line why not."
  @callback able(protocol()) :: :ok | {:error, line :: String.t()}

  @doc "What the options alone say: `{:error, line}` if a base with these cannot be armed."
  @callback able_by(options()) :: :ok | {:error, line :: String.t()}

  @doc "Bytes that stop the base; they are said twice."
  @callback stop_words(options()) :: binary()

  @doc "The last words of a driver that ends in order; by default a stop."
  @callback farewell(options()) :: binary()

  @optional_callbacks able_by: 1, farewell: 1

  @enforce_keys [
    :driver,
    :options,
    :line,
    :ref,
    :ramp,
    :protocol,
    :silent_ms,
    :heard_ms,
    :stepped_ms
  ]
  defstruct @enforce_keys ++ [wanted: Twist.zero(), ordered_ms: nil, said: nil]

  @type t :: %__MODULE__{}

  defmacro __using__(about) do
    quote do
      @behaviour Hal.Drive
      @behaviour Hal.SerialBase
      @about Map.new(unquote(about))

      @doc "Checks the options; the error is one line that says what is wrong."
      @spec options(keyword()) :: {:ok, Hal.SerialBase.options()} | {:error, String.t()}
      def options(given), do: Hal.SerialBase.options(__MODULE__, @about, given)

      @impl Hal.Drive
      def option_table, do: Hal.SerialBase.table(__MODULE__, @about)

      @impl Hal.Drive
      def init(given), do: Hal.SerialBase.init(__MODULE__, @about, given)

      @impl Hal.Drive
      def judge(given), do: Hal.SerialBase.judge(__MODULE__, @about, given)

      @impl Hal.Drive
      def explain(reason, given), do: Hal.SerialBase.explain(@about, reason, given)

      @impl Hal.Drive
      defdelegate drive(twist, state), to: Hal.SerialBase

      @impl Hal.Drive
      defdelegate handle_message(message, state), to: Hal.SerialBase

      @impl Hal.Drive
      defdelegate ready(state), to: Hal.SerialBase

      @impl Hal.Drive
      defdelegate terminate(state), to: Hal.SerialBase
    end
  end

  @doc """
  Takes bytes of a protocol that keeps those of a message that has only begun as `rest`: `cut` splits them into messages and another
  rest, `read` makes readings of one message.
  """
  @spec read(
          protocol,
          binary(),
          (binary() -> {[message], rest :: binary()}),
          (message, protocol -> {[Hal.Drive.reading()], protocol})
        ) :: {[Hal.Drive.reading()], protocol}
        when protocol: map(), message: term()
  def read(protocol, bytes, cut, read) do
    {messages, rest} = cut.(protocol.rest <> bytes)
    Enum.flat_map_reduce(messages, %{protocol | rest: rest}, read)
  end

  @doc false
  def table(driver, about) do
    body = [profile: [{:struct, Profile}, default: nil]]
    Hal.SerialBase.Options.table(about.speed) ++ body ++ driver.own_table()
  end

  @doc false
  def options(driver, about, given) do
    with {:ok, options} <- Options.check(given, table(driver, about), about.subject),
         {:ok, _line} <- Serial.options(Hal.SerialBase.Options.line(options)),
         able = Hal.SerialBase.Options.abilities(about.limits, options[:profile]),
         {:ok, limits} <-
           Hal.SerialBase.Options.limits(options[:limits], able, about.subject),
         do: {:ok, options |> Map.new() |> Map.put(:limits, limits)}
  end

  @doc false
  def judge(driver, about, given) do
    with {:ok, options} <- options(driver, about, given) do
      usual = about.speed
      odd = "speed: #{options.speed} baud is odd; #{usual} is usual"
      odd = if options.speed == usual, do: [], else: [odd]
      {:ok, %{ready: able_by(driver, options), senses: [], odd: odd}}
    end
  end

  defp able_by(driver, options),
    do: if(function_exported?(driver, :able_by, 1), do: driver.able_by(options), else: :ok)

  @doc false
  def explain(about, :silent, given) do
    "#{Hal.SerialBase.Options.line_name(given)}: the base says nothing (is it on, its cable right, its speed " <>
      "#{given[:speed] || about.speed} baud?)"
  end

  def explain(_about, reason, given),
    do: Serial.explain(reason, Hal.SerialBase.Options.line_name(given))

  @doc false
  def init(driver, about, given) do
    options =
      case options(driver, about, given) do
        {:ok, options} -> options
        {:error, line} -> raise ArgumentError, line
      end

    words = :binary.copy(driver.stop_words(options), 2)

    with {:ok, line} <-
           Serial.open(Hal.SerialBase.Options.line(options) ++ [last_words: words]) do
      at_ms = now(options)
      before = Process.delete(key(driver, options))
      {bytes, protocol} = driver.new(options, before, at_ms)

      opened = %__MODULE__{
        driver: driver,
        options: options,
        line: line,
        ref: make_ref(),
        ramp: options.limits,
        protocol: protocol,
        silent_ms: Map.get(about, :silent_ms, @silent_ms),
        heard_ms: at_ms,
        stepped_ms: at_ms
      }

      Process.send_after(self(), {__MODULE__, opened.ref, :tick}, @tick_ms)
      opened(write(opened, bytes))
    end
  end

  defp opened({:ok, s}), do: {:ok, s}

  defp opened({:error, reason, s}) do
    Serial.close(s.line)
    {:error, reason}
  end

  @doc false
  def drive(twist, s) do
    at_ms = now(s.options)
    wanted = if SlewLimiter.check(twist) == :ok, do: twist, else: Twist.zero()
    s = step(%{s | wanted: wanted, ordered_ms: at_ms}, at_ms)
    if s.ramp.twist == s.said, do: {:ok, s}, else: say(s, at_ms)
  end

  @doc false
  def handle_message({__MODULE__, ref, :tick}, %{ref: ref} = s) do
    Process.send_after(self(), {__MODULE__, ref, :tick}, @tick_ms)
    at_ms = now(s.options)

    # A driver that was silent itself does not say so of its base.
    with :ok <- keep_alive(s),
         :ok <- alive(s, at_ms),
         {:ok, s} <- s |> step(at_ms) |> say(at_ms),
         do: {:ok, [], s}
  end

  def handle_message(message, s) do
    case Serial.handle(s.line, message) do
      {:data, bytes} -> hear(s, bytes, now(s.options))
      {:error, reason} -> {:error, reason, s}
      :unknown -> {:ok, [], s}
    end
  end

  @doc false
  def ready(%{driver: driver} = s) do
    with :ok <- able_by(driver, s.options), do: driver.able(s.protocol)
  end

  @doc false
  def terminate(%{driver: driver, options: options} = s) do
    # For the device's next opening.
    Process.put(key(driver, options), driver.keep(s.protocol))

    if function_exported?(driver, :farewell, 1),
      do: Serial.last_words(s.line, driver.farewell(options))

    Serial.close(s.line)
  end

  defp key(driver, options), do: {driver, Hal.SerialBase.Options.line_name(options)}

  defp hear(s, bytes, at_ms) do
    {readings, answer, protocol} = s.driver.hear(s.protocol, bytes, at_ms)
    # Noise is not a sign of a base.
    heard_ms = if readings == [], do: s.heard_ms, else: at_ms

    with {:ok, s} <- write(%{s | protocol: protocol, heard_ms: heard_ms}, answer),
         do: {:ok, readings, s}
  end

  defp step(s, at_ms) do
    wanted = if fresh?(s, at_ms) and ready(s) == :ok, do: s.wanted, else: Twist.zero()
    {_twist, ramp} = SlewLimiter.step(s.ramp, wanted, (at_ms - s.stepped_ms) / 1_000)
    %{s | ramp: ramp, stepped_ms: at_ms}
  end

  defp fresh?(%{ordered_ms: nil}, _at_ms), do: false
  defp fresh?(s, at_ms), do: at_ms - s.ordered_ms < @order_ms

  defp say(%{ramp: %{twist: twist}} = s, at_ms) do
    {bytes, protocol} = s.driver.say(s.protocol, twist, fresh?(s, at_ms), at_ms)
    write(%{s | protocol: protocol, said: twist}, bytes)
  end

  defp keep_alive(s) do
    case Serial.keep_alive(s.line) do
      :ok -> :ok
      # The line is behind, but has not lost anything.
      {:error, :overrun} -> :ok
      {:error, reason} -> {:error, reason, s}
    end
  end

  defp alive(s, at_ms),
    do: if(at_ms - s.heard_ms >= s.silent_ms, do: {:error, :silent, s}, else: :ok)

  defp write(s, bytes) do
    case Serial.write(s.line, bytes) do
      :ok -> {:ok, s}
      # What did not fit is old at the next tick, which says it anew.
      {:error, :overrun} -> {:ok, s}
      {:error, reason} -> {:error, reason, s}
    end
  end

  defp now(%{clock: {m, f, a}}), do: apply(m, f, a)
end
