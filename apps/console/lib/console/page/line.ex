defmodule Console.Page.Line do
  @moduledoc """
  Reads a line that the page says: `@MS TEXT`, with the time when it was given by the clock of this node, in ms
  (`System.monotonic_time/1`), and what a person has typed or clicked. Pure.

  The page knows that clock from the scenes, which bear its time. It takes them for as new as the fastest of them was, so
  an order never seems younger than it is. One without a time is refused; a stop and a question need none.
  """
  alias Console.{Orders, Prompt, Teleop}

  # The time, and what stands about it.
  @stamp_bytes 20

  @doc "The longest line, in bytes."
  @spec most_bytes() :: pos_integer()
  def most_bytes, do: Prompt.most_bytes() + @stamp_bytes

  @doc """
  The text of a line and when it was given, in microseconds, but not later than it was heard; `nil` if it does not say so.

      iex> Console.Page.Line.given("@1500 goto mag1 1,2", 2_000_000)
      {"goto mag1 1,2", 1_500_000}
      iex> Console.Page.Line.given("@2500 start", 2_000_000)
      {"start", 2_000_000}
      iex> Console.Page.Line.given("estop", 2_000_000)
      {"estop", nil}
  """
  @spec given(String.t(), heard_us :: integer()) :: {String.t(), integer() | nil}
  def given("@" <> stamped = line, heard_us) do
    with [stamp, text] <- String.split(stamped, " ", parts: 2),
         {ms, ""} when abs(ms) < 1.0e15 <- Integer.parse(stamp) do
      {text, min(ms * 1_000, heard_us)}
    else
      _no_time -> {line, nil}
    end
  end

  def given(line, _heard_us), do: {line, nil}

  @doc """
  The order of a text, for `Console.Orders`; `{:look, robot}` for the robot that is looked at (`look mag1`, and `look` for
  none), `{:watch, what, on?}` for whether the messages between robots or the nodes are (`messages on`, `nodes off`), `present` that a person sees the page. The error says in one line what is allowed.
  """
  @spec order(String.t(), integer() | nil, [atom()], {module(), live :: term()}) ::
          {:ok, Orders.order()}
          | {:look, atom() | nil}
          | {:watch, :messages | :nodes, boolean()}
          | {:error, String.t()}
  def order("look" <> name, _given_us, robots, _source),
    do: {:look, Enum.find(robots, &(Atom.to_string(&1) == String.trim(name)))}

  def order("messages " <> word, _given_us, _robots, _source) when word in ["on", "off"],
    do: {:watch, :messages, word == "on"}

  def order("nodes " <> word, _given_us, _robots, _source) when word in ["on", "off"],
    do: {:watch, :nodes, word == "on"}

  def order("present", given_us, _robots, _source) when given_us != nil,
    do: {:ok, Orders.of_presence(given_us)}

  def order(text, given_us, robots, {module, live} = source) do
    if function_exported?(module, :answer, 2),
      do: {:ok, question(text, text, given_us, fn -> module.answer(live, text) end)},
      else: spoken(text, given_us, robots, source)
  end

  defp spoken(text, given_us, robots, source) do
    case Teleop.word(text, robots) do
      {:ok, robot, stick} -> timed(Orders.of_word(robot, stick, :page, source, given_us))
      :other -> typed(text, Prompt.parse(text, robots), given_us, source)
      error -> error
    end
  end

  defp timed(%{kind: kind, given_us: nil}) when kind != :stop,
    do: {:error, "an order must say when it was given; load the page again"}

  defp timed(order), do: {:ok, order}

  defp typed(_text, {:error, _line} = error, _given_us, _source), do: error

  defp typed(text, {:ok, parsed}, given_us, source) do
    if Prompt.kind(parsed) == :view,
      do: view(parsed, text, given_us, source),
      else: timed(Orders.of_line(text, parsed, source, given_us))
  end

  defp view(:nothing, _text, _given_us, _source),
    do: {:error, "type a command; help lists them"}

  defp view(:quit, _text, _given_us, _source),
    do: {:error, "the page is closed in the browser, its program in the terminal"}

  defp view(:page, _text, _given_us, _source),
    do: {:error, "this is the page; its address is that of your browser"}

  defp view({hand, _whom}, _text, _given_us, _source) when hand in [:drive, :gamepad],
    do: {:error, "#{hand} is for the terminal; here the keys drive by the button Drive by keys"}

  defp view(question, text, given_us, {module, live}),
    do: {:ok, question(question, text, given_us, fn -> {:ok, lines(question, module, live)} end)}

  defp question(key, text, given_us, answer) do
    %{
      kind: :question,
      key: key,
      line: text,
      given_us: given_us,
      run: fn _age_ms -> answer.() end
    }
  end

  defp lines(:help, module, live), do: Prompt.help(module.offers(live))
  defp lines(:nodes, module, live), do: module.lines(live)
  defp lines(:status, module, live), do: module.status(live, :all)
  defp lines({:status, name}, module, live), do: module.status(live, name)
end
