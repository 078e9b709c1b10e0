defmodule Hal.DriveCase do
  @moduledoc """
  Runs any drive at a base that is emulated, and says what does not hold that must hold for all. For tests:

      @tag timeout: 300_000
      test "what holds for every drive" do
        assert Hal.DriveCase.problems({Mine.TextBase, []}, {Sim.Emulator, core: {Mine.TextBase.Emulator, []}}) == []
      end

  `Hal.Device` runs the driver, as in a robot, with the base's line as its option `port:`; the base is a `Hal.Emulated` with the
  callback below, such as `Sim.Emulator`, whose core has a `wheels/2`. Each rule is a run of its own, in real time: the
  speed that counts is the one that the base gives its wheels, not the one that the driver reports.

  | rule | must hold |
  |---|---|
  | `:options` | an option that it does not know is refused in one line that names it |
  | `:missing` | a port that is not there is an error, and in words one line that names it |
  | `:stands` | once it is open the base is online, and stands |
  | `:drives` | forwards, backwards, left and right are those of its wheels and of its odometry |
  | `:limits` | whatever is asked, the wheels get no faster than its options allow; what is no speed stops them |
  | `:stop` | a stop stops them |
  | `:silence` | so does silence |
  | `:close` | so does the end of the device |
  | `:killed` | so does the killing of its process |
  | `:program` | so does, in the end, the killing of the line's port program, and it comes back |
  | `:junk` | noise on the line neither ends it nor makes its state grow, and it drives on |
  | `:messages` | nor do messages that it does not know |
  | `:arming` | wheels that are not armed stand, whatever is asked; disarmed they stop |
  | `:unplug` | a pulled cable is an error; once it is back the wheels stand until a person has acknowledged and armed |
  | `:restart` | a base that is switched off and on is found again, and odometry does not jump in one frame |
  """
  alias Hal.{Device, DeviceCase, Options, Twist}
  import Hal.DeviceCase, only: [one_line: 2, tell: 2, words: 2]
  import Hal.DriveCase.Run

  @doc "The speed that the base gives its wheels now."
  @callback wheels(GenServer.server()) :: Twist.t()

  @rules [
    :options,
    :missing,
    :stands,
    :drives,
    :limits,
    :stop,
    :silence,
    :close,
    :killed,
    :program,
    :junk,
    :messages,
    :arming,
    :unplug,
    :restart
  ]
  @table DeviceCase.table(@rules, 60_000) ++
           [
             max_linear: [{:number, 0.01, 10, "m/s"}, default: 0.5],
             max_turn: [{:number, 0.01, 10, "rad/s"}, default: 1.0],
             sonar: [:boolean, default: false]
           ]

  @doc """
  What does not hold, one line each. Options: `only` (these rules), `max_linear` and `max_turn` (what the driver's options
  allow, 0.5 m/s and 1.0 rad/s), `sonar` (whether its base has any), `wait_ms` (how long a busy machine may take for what must come, 20,000), `bytes` (how
  large the device's state may be, 60,000), `seed` (of the noise). Raises `ArgumentError` for options that are wrong.
  """
  @spec problems(driver :: {module(), keyword()}, base :: {module(), keyword()}, keyword()) ::
          [String.t()]
  def problems({_, _} = driver, {_, _} = base, options \\ []) do
    options = Options.check!(options, @table, "drive case")
    linear = min(options[:max_linear] / 2, 0.2)
    turn = min(options[:max_turn] / 2, 0.5)

    DeviceCase.problems(
      %Hal.DriveCase.Run{
        driver: driver,
        emulated: base,
        options: options,
        speed: {linear, turn}
      },
      &rule/2
    )
  end

  defp rule(:options, t), do: DeviceCase.refuses(t)

  defp rule(:missing, t) do
    DeviceCase.with_device(t, device(t, :auto), fn t ->
      with {:ok, t} <-
             await(t, "is not offline, and has no port", &match?({:offline, _}, health(&1))) do
        {:offline, reason} = health(t)
        one_line(words(t, reason), t.link)
      end
    end)
  end

  defp rule(:stands, t),
    do: on_base(t, :auto, &hold(&1, "moves untold", fn t -> standing?(t) end))

  defp rule(:drives, t) do
    {linear, turn} = t.speed

    on_base(t, :auto, fn t ->
      with {:ok, t} <- goes(t, Twist.new(linear, 0), "forwards", &(&1.linear > 0)),
           {:ok, t} <- goes(t, Twist.new(-linear, 0), "backwards", &(&1.linear < 0)),
           {:ok, t} <- goes(t, Twist.new(0, turn), "left", &(&1.turn > 0)),
           do: goes(t, Twist.new(0, -turn), "right", &(&1.turn < 0))
    end)
  end

  defp rule(:limits, t) do
    %{max_linear: linear, max_turn: turn} = Map.new(t.options)
    # A base rounds, and has a ramp of its own.
    within? = fn t ->
      wheels = wheels(t)
      abs(wheels.linear) <= 1.05 * linear + 0.02 and abs(wheels.turn) <= 1.05 * turn + 0.05
    end

    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t),
           {:ok, t} <-
             hold(order(t, Twist.new(99, 0)), "drives faster than #{linear} m/s", within?),
           {:ok, t} <-
             hold(order(t, Twist.new(0, -99)), "turns faster than #{turn} rad/s", within?),
           {:ok, t} <- hold(order(t, Twist.new(99, 99)), "is faster than its limits", within?),
           {:ok, t} <- stands(order(t, %Twist{linear: :nan, turn: 0.0}), "a speed that is none"),
           do: alive(t, "a speed that is none")
    end)
  end

  defp rule(:stop, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t), do: stands(order(t, Twist.zero()), "a stop")
    end)
  end

  defp rule(:silence, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t), do: stands(order(t, nil), "silence")
    end)
  end

  defp rule(:close, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t) do
        DeviceCase.close(t.device)
        stands(order(t, nil), "the end of its device")
      end
    end)
  end

  defp rule(:killed, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t) do
        Process.exit(t.device, :kill)
        stands(order(t, nil), "the killing of its process")
      end
    end)
  end

  defp rule(:program, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t), [_ | _] = programs <- DeviceCase.programs(t) do
        DeviceCase.kill(programs)

        with {:ok, t} <- stands(order(t, nil), "the killing of its port program"),
             {:ok, t} <- online(t),
             do: rolls(t)
      else
        [] -> :ok
        error -> error
      end
    end)
  end

  defp rule(:junk, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t),
           {:ok, t} <- noise(t, 40, :rand.seed_s(:exsss, t.options[:seed])),
           {:ok, t} <- alive(t, "noise on the line"),
           {:ok, t} <- online(t),
           {:ok, t} <- rolls(t),
           do: DeviceCase.small(t)
    end)
  end

  defp rule(:messages, t) do
    on_base(t, :auto, fn t ->
      for junk <- [:junk, {:junk, 1}, {make_ref(), {:data, "junk"}}, nil],
          do: send(t.device, junk)

      with {:ok, t} <- hold(t, "", fn _t -> true end),
           {:ok, t} <- rolls(t),
           do: alive(t, "messages that it does not know")
    end)
  end

  defp rule(:arming, t) do
    on_base(t, :manual, fn t ->
      driven = order(t, forwards(t))

      with {:ok, t} <- hold(driven, "moves although it is not armed", &standing?/1),
           {:ok, t} <- armed(t),
           {:ok, t} <- rolls(t),
           :ok <- Device.disarm(t.device),
           {:ok, t} <- stands(t, "being disarmed"),
           do: hold(t, "moves although it is disarmed", &standing?/1)
    end)
  end

  defp rule(:unplug, t) do
    on_base(t, :manual, fn t ->
      with {:ok, t} <- armed(t),
           {:ok, t} <- rolls(t),
           :ok <- tell(t, :unplug),
           {:ok, t} <-
             await(t, "is not offline, and has no cable", &match?({:offline, _}, health(&1))),
           :ok <- tell(t, :plug),
           {:ok, t} <- online(t),
           {:ok, t} <- stands(t, "its cable being back"),
           {:ok, t} <- hold(t, "moves although its line was lost", &standing?/1),
           {:error, _acknowledge} <- Device.arm(t.device),
           :ok <- Device.acknowledge(t.device),
           {:ok, t} <- armed(t),
           {:ok, t} <- rolls(t) do
        unjumped(t)
      else
        :ok -> {:error, "may be armed although nobody has acknowledged that its line was lost"}
        error -> error
      end
    end)
  end

  defp rule(:restart, t) do
    on_base(t, :auto, fn t ->
      with {:ok, t} <- rolls(t),
           :ok <- tell(t, :restart),
           {:ok, t} <- hold(t, "", fn _t -> true end),
           {:ok, t} <- online(t),
           {:ok, t} <- rolls(t),
           {:ok, t} <- alive(t, "its base's restart"),
           do: unjumped(t)
    end)
  end

  # Steps of the rules: `{:ok, t}`, or `{:error, line}`.

  defp on_base(t, arm, rule) do
    DeviceCase.on_emulated(t, device(t, arm), fn t ->
      with {:ok, t} <- online(t), do: rule.(t)
    end)
  end

  defp device(t, arm), do: [arm: arm, sonar: t.options[:sonar]]

  defp forwards(%{speed: {linear, _turn}}), do: Twist.new(linear, 0)

  defp rolls(t) do
    await(order(t, forwards(t)), "does not drive", &(wheels(&1).linear > 0.5 * elem(t.speed, 0)))
  end

  defp stands(t, after_what), do: await(t, "does not stand after #{after_what}", &standing?/1)

  # The wheels, and what odometry says of them.
  defp goes(t, twist, way, right?) do
    moves? = fn t -> not standing?(t) and right?.(wheels(t)) and right?.(measured(t)) end

    with {:ok, t} <- await(order(t, twist), "does not go #{way}, or does not say so", moves?),
         do: stands(order(t, Twist.zero()), "a stop on its way #{way}")
  end

  defp online(t), do: await(t, "does not come online", &(health(&1) == :online))

  defp armed(t), do: await(t, "cannot be armed", fn t -> Device.arm(t.device) == :ok end)

  defp alive(t, after_what) do
    with :ok <- DeviceCase.alive(t, after_what), do: {:ok, t}
  end

  defp unjumped(%{jumped?: true}), do: {:error, "its odometry jumps within one frame"}
  defp unjumped(t), do: {:ok, t}
end
