defmodule Console.Orders do
  @moduledoc """
  Carries out what a person orders by page, prompt, keys or gamepad, one order after the other, each with the time when it was
  given.

  An order that has waited for half a second is not carried out, and robots refuse one that was given before they
  were stopped (`Swarm.given/2`). A stop does not wait: it starts beside the order that is under way, and the orders that
  wait are dropped. Of more than eight that wait the oldest is dropped. Whatever is dropped is answered. What is given after
  an emergency stop waits until that is answered, so that a reset never overtakes it; a question does not wait.

  A word of driving takes the place of the one of the same robot that still waits. It lasts from when it was said, not
  from when its turn comes.

  The process does not wait: each order runs in a process of its own, linked to it.
  """
  use GenServer
  alias Console.{Prompt, Teleop}
  alias Swarm.Order.Freshness

  @most 8
  @longest_ms 500

  @typedoc """
  What there is to do: `run` gets the age of the order in ms. A `:stop` goes past all others, and one of its `key` is
  under way at a time; so does `:present`, which is dropped while one is under way, and never answered. A `{:word, robot, longest_ms}` is dropped in silence when it is older, and answered only if it was
  refused. A `:question` may have any age.
  """
  @type order :: %{
          kind:
            :order | :stop | :present | :question | {:word, atom(), longest_ms :: pos_integer()},
          key: term(),
          line: String.t(),
          given_us: integer(),
          run: (age_ms :: non_neg_integer() -> answer())
        }
  @type answer :: {:ok, String.t() | [String.t()]} | {:error, String.t()}

  @doc """
  Starts it, linked to the caller, for the orders of this giver (`Swarm.by/2`); `answer` is called with the line of each order and
  its answer.
  """
  @spec start_link(giver :: String.t(), (String.t(), answer() -> term())) :: {:ok, pid()}
  def start_link(giver, answer), do: GenServer.start_link(__MODULE__, {giver, answer})

  @doc "Gives an order. It waits for nothing."
  @spec give(pid(), order()) :: :ok
  def give(orders, order), do: GenServer.cast(orders, {:give, order})

  @doc "The order of a line that `Console.Prompt` has parsed, for a fleet (`Console.Live`)."
  @spec of_line(String.t(), Console.Live.command(), {module(), live :: term()}, integer()) ::
          order()
  def of_line(line, command, {module, live}, given_us) do
    %{
      kind: Prompt.kind(command),
      key: command,
      line: Prompt.said(line, command),
      given_us: given_us,
      run: fn _age_ms -> module.command(live, command) end
    }
  end

  @doc "The order of a word of driving."
  @spec of_word(
          atom(),
          Teleop.stick(),
          :page | :gamepad | :terminal,
          {module(), live :: term()},
          given_us :: integer()
        ) :: order()
  def of_word(robot, stick, by, {module, live}, given_us) do
    %{
      kind: {:word, robot, Teleop.word_ms(by)},
      key: robot,
      line: "drive",
      given_us: given_us,
      run: fn age_ms -> module.command(live, Teleop.order(robot, stick, by, age_ms)) end
    }
  end

  @doc """
  The order of a word of driving with speeds: ahead in m/s, to the left in rad/s; it lasts `longest_ms` from when it was given.

      iex> live = {Console.Orders, nil}
      iex> Console.Orders.of_speed(:mag1, {0.2, 0.0}, 500, live, 0).kind
      {:word, :mag1, 500}
  """
  @spec of_speed(
          atom(),
          {ahead :: float(), left :: float()},
          longest_ms :: pos_integer(),
          {module(), live :: term()},
          given_us :: integer()
        ) :: order()
  def of_speed(robot, {ahead, left}, longest_ms, {module, live}, given_us) do
    %{
      kind: {:word, robot, longest_ms},
      key: robot,
      line: "drive",
      given_us: given_us,
      run: fn age_ms ->
        for_s = max(longest_ms - age_ms, 0) / 1_000
        module.command(live, {:tell, [robot], {:move, ahead, left, for_s}})
      end
    }
  end

  @doc "That a person was heard then, for robots that move only in the presence of one."
  @spec of_presence(given_us :: integer()) :: order()
  def of_presence(given_us) do
    said = fn _age_ms -> with :ok <- Swarm.present(), do: {:ok, "present"} end
    %{kind: :present, key: :present, line: "present", given_us: given_us, run: said}
  end

  @doc "Returns when all that was given before has been carried out and answered, or dropped."
  @spec settle(pid()) :: :ok
  def settle(orders), do: GenServer.call(orders, :settle, :infinity)

  @doc "The refusal of an order that was dropped when a stop came."
  @spec stopped() :: {:error, String.t()}
  def stopped, do: {:error, "not carried out: stopped before its turn came"}

  @impl GenServer
  def init({giver, answer}) do
    {:ok, %{giver: giver, answer: answer, waiting: [], running: nil, stops: %{}, settling: []}}
  end

  @impl GenServer
  def handle_cast({:give, %{kind: :stop} = stop}, s) do
    s.waiting
    |> Enum.reject(&match?({:word, _, _}, &1.kind))
    |> Enum.each(&told(s, &1, stopped()))

    s = %{s | waiting: []}

    # The one under way may have reached some robots before others have moved.
    case Enum.find(s.stops, fn {_ref, {under_way, _next}} -> under_way.key == stop.key end) do
      nil -> {:noreply, put_in(s.stops[begin(s, stop)], {stop, nil})}
      {ref, {under_way, _next}} -> {:noreply, put_in(s.stops[ref], {under_way, stop})}
    end
  end

  def handle_cast({:give, %{kind: :present} = word}, s) do
    if Enum.any?(s.stops, &match?({_ref, {%{kind: :present}, _again}}, &1)),
      do: {:noreply, s},
      else: {:noreply, put_in(s.stops[begin(s, word)], {word, nil})}
  end

  def handle_cast({:give, order}, s), do: {:noreply, next(%{s | waiting: wait(s, order)})}

  @impl GenServer
  def handle_call(:settle, from, s), do: {:noreply, settled(%{s | settling: [from | s.settling]})}

  @impl GenServer
  def handle_info({ref, answer}, s) when is_reference(ref) do
    Process.demonitor(ref, [:flush])
    {:noreply, s |> ended(ref, answer) |> next() |> settled()}
  end

  defp ended(%{running: {ref, order}} = s, ref, answer) do
    told(s, order, answer)
    %{s | running: nil}
  end

  defp ended(s, ref, answer) do
    {{stop, again}, stops} = Map.pop!(s.stops, ref)
    told(s, stop, answer)

    if again,
      do: put_in(%{s | stops: stops}.stops[begin(s, again)], {again, nil}),
      else: %{s | stops: stops}
  end

  # The newest last.
  defp wait(s, %{kind: {:word, robot, _longest_ms}} = word),
    do: Enum.reject(s.waiting, &match?({:word, ^robot, _}, &1.kind)) ++ [word]

  defp wait(s, order) do
    {over, kept} = Enum.split(s.waiting ++ [order], max(length(s.waiting) + 1 - @most, 0))
    Enum.each(over, &told(s, &1, {:error, "not carried out: #{@most} newer orders wait"}))
    kept
  end

  defp next(%{running: nil, waiting: [first | _]} = s) do
    stopping? = Enum.any?(s.stops, &match?({_ref, {%{key: :estop}, _again}}, &1))
    order = if stopping?, do: Enum.find(s.waiting, &(&1.kind == :question)), else: first
    if order, do: next(order, %{s | waiting: List.delete(s.waiting, order)}), else: s
  end

  defp next(s), do: s

  defp next(order, s) do
    case timely(order, age_ms(order)) do
      :ok ->
        %{s | running: {begin(s, order), order}}

      late ->
        told(s, order, late)
        next(s)
    end
  end

  defp timely(%{kind: :order}, age_ms) when age_ms >= @longest_ms, do: Freshness.late(age_ms)
  defp timely(%{kind: {:word, _robot, longest_ms}}, age_ms) when age_ms >= longest_ms, do: :late
  defp timely(_order, _age_ms), do: :ok

  defp begin(s, order) do
    age_ms = age_ms(order)
    run = fn -> Swarm.by(s.giver, fn -> order.run.(age_ms) end) end
    Task.async(fn -> Swarm.given(order.given_us, run) end).ref
  end

  defp age_ms(%{given_us: given_us}),
    do: max(div(System.monotonic_time(:microsecond) - given_us, 1_000), 0)

  # Words come ten times a second: only a refusal is told.
  defp told(_s, %{kind: {:word, _robot, _longest_ms}}, answer) when answer == :late, do: :ok
  defp told(_s, %{kind: {:word, _robot, _longest_ms}}, {:ok, _accepted}), do: :ok
  defp told(_s, %{kind: :present}, _answer), do: :ok
  defp told(s, order, answer), do: s.answer.(order.line, answer)

  defp settled(%{running: nil, waiting: [], stops: stops} = s) when stops == %{} do
    Enum.each(s.settling, &GenServer.reply(&1, :ok))
    %{s | settling: []}
  end

  defp settled(s), do: s
end
