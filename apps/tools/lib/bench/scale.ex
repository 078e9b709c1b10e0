defmodule Bench.Scale do
  @moduledoc """
  Measures what a robot costs in fleets of different sizes: `mix bench scale`. A whole mission in lockstep, from the search until the
  fleet has been in formation for ten seconds, in a process of its own, is measured in what all robots together took, divided by their
  number and that of the steps (100 ms).
  """
  alias Lab.Trial

  # Steps of 100 ms.
  @after_formed 100

  @typedoc """
  Of one fleet: the reductions of the VM and the processor time for a robot in a step, the simulated seconds that a second of processor
  time plays, the memory of the run at its end; how many simulated seconds were measured, and when the fleet was formed (`nil`: not within
  these).
  """
  @type measured :: %{
          robots: pos_integer(),
          seconds: float(),
          formed_s: float() | nil,
          reductions: float(),
          cpu_us: float(),
          speed: float(),
          bytes: pos_integer()
        }

  @doc "Measures a mission of one fleet, and no more than so many simulated seconds of it; the error is one line of `Lab.Trial.new/1`."
  @spec measure(pos_integer(), :painted | :direct, pos_integer()) ::
          {:ok, measured()} | {:error, line :: String.t()}
  def measure(robots, blobs, seconds) do
    options = %{robots: Console.Fleet.of(robots), seed: 1, blobs: blobs, duration_s: 10_000}

    with {:ok, setup} <- Trial.setup(options) do
      {:ok, fn -> run(setup, 10 * seconds) end |> Task.async() |> Task.await(:infinity)}
    end
  end

  defp run(setup, steps) do
    robots = length(setup.options.robots)
    Trial.Memory.prepare(robots)
    before = {work(), cpu_ms()}
    {trial, steps, formed} = play(Trial.begin(setup), 0, steps, nil)
    measured = figures(before, robots, steps)
    # Alive until here.
    _living = Trial.living(trial)
    Map.put(measured, :formed_s, formed && formed / 10)
  end

  defp play(trial, step, most, formed)
       when step == most or (formed != nil and step == formed + @after_formed),
       do: {trial, step, formed}

  defp play(trial, step, most, formed) do
    trial = Trial.step(trial)
    formed = formed || if(Trial.formed?(trial), do: step + 1)
    play(trial, step + 1, most, formed)
  end

  defp figures({work, cpu_ms}, robots, steps) do
    {:memory, bytes} = Process.info(self(), :memory)
    spent_ms = max(cpu_ms() - cpu_ms, 1)

    %{
      robots: robots,
      seconds: steps / 10,
      reductions: (work() - work) / (robots * steps),
      cpu_us: 1_000 * spent_ms / (robots * steps),
      speed: 100 * steps / spent_ms,
      bytes: bytes
    }
  end

  defp work do
    {:reductions, count} = Process.info(self(), :reductions)
    count
  end

  defp cpu_ms do
    {ms, _since_last} = :erlang.statistics(:runtime)
    ms
  end

  @doc """
  One line about what one core of this machine manages in real time, as measured.

      iex> one = fn robots, speed -> %{robots: robots, speed: speed} end
      iex> Bench.Scale.verdict([one.(6, 41.0), one.(50, 1.1), one.(100, 0.1)])
      "In real time one core of this machine plays fleets of 6 and 50 robots, and not one of 100 (0.10 times)."
      iex> Bench.Scale.verdict([one.(6, 41.0)])
      "In real time one core of this machine plays a fleet of 6 robots."
  """
  @spec verdict([measured(), ...]) :: String.t()
  def verdict(all) do
    {able, unable} = Enum.split_with(all, &(&1.speed >= 1.0))

    played =
      case Enum.map(able, & &1.robots) do
        [] -> "none of these fleets"
        [one] -> "a fleet of #{one} robots"
        several -> "fleets of #{list(several)} robots"
      end

    missed = for one <- unable, do: "#{one.robots} (#{decimals(one.speed, 2)} times)"

    "In real time one core of this machine plays #{played}" <>
      if(missed == [], do: "", else: ", and not one of #{list(missed)}") <> "."
  end

  defp list([one]), do: "#{one}"

  defp list(several) do
    {first, [last]} = Enum.split(several, -1)
    Enum.join(first, ", ") <> " and #{last}"
  end

  @heads [
    "robots",
    "formed after (s)",
    "times real time",
    "processor time a robot-step (us)",
    "against the smallest fleet",
    "reductions a robot-step",
    "against the smallest fleet",
    "memory (MB)"
  ]

  @doc "The table in Markdown, and the processor time of a robot-step as bars; the smallest fleet first."
  @spec draw([measured(), ...]) :: String.t()
  def draw([least | _] = all) do
    rows =
      for one <- all do
        [
          one.robots,
          if(one.formed_s, do: decimals(one.formed_s, 1), else: "not in #{round(one.seconds)}"),
          decimals(one.speed, 2),
          decimals(one.cpu_us, 0),
          decimals(one.cpu_us / max(least.cpu_us, 1.0), 2),
          decimals(one.reductions, 0),
          decimals(one.reductions / least.reductions, 2),
          decimals(one.bytes / 1.0e6, 0)
        ]
      end

    table = Bench.Table.markdown(@heads, rows)

    table <> "\n" <> Enum.map_join(all, &bar(&1, Enum.max(Enum.map(all, fn a -> a.cpu_us end))))
  end

  @bar 50

  defp bar(one, most) do
    length = max(round(@bar * one.cpu_us / max(most, 1.0)), 1)

    "#{String.pad_leading("#{one.robots}", 5)} robots #{String.duplicate("█", length)} #{decimals(one.cpu_us, 0)} us\n"
  end

  defp decimals(number, count), do: Console.Cli.Format.decimals(number, count)
end
