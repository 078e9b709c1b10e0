defmodule Console.Page.Client do
  @moduledoc false
  # Carries out what a person types and clicks on the page, one after the other.
  #
  # The dead man's switch of a robot that is driven by keyboard is the robot's own: each word of the page is an order to move
  # for 300 ms. Whatever is gone then, the keyboard, the browser, this process, its node or the network, the robot stands.
  # A word that has waited here for longer is not passed on.
  use GenServer
  alias Console.Page.{About, Feed, State}
  alias Console.Teleop
  alias Console.Prompt

  @most 1.0
  # How often the page is told of the robot that it looks at.
  @about_ms 200

  @doc """
  Starts it for the connection of the caller, and linked to it: without one of them the other is of no use, and the page
  connects again. `reply` writes text to the browser.
  """
  @spec start_link(pid(), (... -> [atom()]), (String.t() -> term())) :: {:ok, pid()}
  def start_link(feed, robots, reply),
    do: GenServer.start_link(__MODULE__, {self(), feed, robots, reply})

  @doc "Carries out a line; its answer goes to the browser."
  @spec obey(pid(), String.t()) :: :ok
  def obey(client, line), do: GenServer.cast(client, {:obey, line, Hal.Clock.now_ms()})

  @doc """
  A word of the keyboard: the robot, its speed forward and its turn, as parts of the greatest (-1 to 1).

      iex> Console.Page.Client.drive("drive mag1 1 -0.5", [:mag1])
      {:ok, :mag1, {1.0, -0.5}}
      iex> Console.Page.Client.drive("drive mag1 9 x", [:mag1])
      {:error, "drive needs a robot and two numbers from -1 to 1: drive mag1 0.5 0"}
  """
  @spec drive(String.t(), [atom()]) ::
          {:ok, atom(), {float(), float()}} | {:error, String.t()} | :other
  def drive("drive" <> rest, robots) do
    with [name, ahead, turn] <- String.split(rest),
         robot when robot != nil <- Enum.find(robots, &(Atom.to_string(&1) == name)),
         {ahead, ""} when abs(ahead) <= @most <- Float.parse(ahead),
         {turn, ""} when abs(turn) <= @most <- Float.parse(turn) do
      {:ok, robot, {ahead, turn}}
    else
      _wrong -> {:error, "drive needs a robot and two numbers from -1 to 1: drive mag1 0.5 0"}
    end
  end

  def drive(_line, _robots), do: :other

  @impl GenServer
  def init({connection, feed, robots, reply}) do
    ref = Process.monitor(connection)
    {module, live} = Feed.source(feed)
    s = %{connection: ref, feed: feed, module: module, live: live, robots: robots, reply: reply}
    {:ok, Map.put(s, :looked, nil)}
  end

  # `look mag1`, and `look` for nobody.
  @impl GenServer
  def handle_cast({:obey, "look" <> name, _said_ms}, s) do
    robot = Enum.find(s.robots.(), &(Atom.to_string(&1) == String.trim(name)))
    if robot && s.looked == nil, do: send(self(), :about)
    {:noreply, %{s | looked: robot}}
  end

  def handle_cast({:obey, line, said_ms}, s) do
    case drive(line, s.robots.()) do
      {:ok, robot, speed} -> {:noreply, drive(s, robot, speed, Hal.Clock.now_ms() - said_ms)}
      :other -> {:noreply, answer(s, line, carry_out(line, s))}
      error -> {:noreply, answer(s, line, error)}
    end
  end

  @impl GenServer
  def handle_info(:about, %{looked: nil} = s), do: {:noreply, s}

  def handle_info(:about, s) do
    with %{} = about <- s.module.about(s.live, s.looked) do
      about = Map.put(about, :events, Feed.events(s.feed, s.looked))
      s.reply.(About.json(s.looked, about))
    end

    _timer = Process.send_after(self(), :about, @about_ms)
    {:noreply, s}
  end

  # A connection that ends as it should takes no linked process along.
  def handle_info({:DOWN, ref, :process, _pid, _reason}, %{connection: ref} = s),
    do: {:stop, :normal, s}

  defp drive(s, robot, stick, waited_ms) do
    with true <- waited_ms <= Teleop.word_ms(:page),
         {:error, line} <- s.module.command(s.live, Teleop.order(robot, stick, :page)),
         do: answer(s, "drive", {:error, line}),
         else: (_late_or_accepted -> s)
  end

  defp answer(s, line, answer) do
    s.reply.(State.answer(line, answer))
    s
  end

  defp carry_out(line, s) do
    case Prompt.parse(line, s.robots.()) do
      {:ok, :nothing} ->
        {:error, "type a command; help lists them"}

      {:ok, :quit} ->
        {:error, "the page is closed in the browser, its program in the terminal"}

      {:ok, {hand, _whom}} when hand in [:drive, :gamepad] ->
        {:error, "#{hand} is for the terminal; here the keys drive by the button Drive by keys"}

      {:ok, :help} ->
        {:ok, Prompt.help(s.module.offers(s.live))}

      {:ok, :nodes} ->
        {:ok, s.module.lines(s.live)}

      {:ok, :status} ->
        {:ok, s.module.status(s.live, :all)}

      {:ok, {:status, name}} ->
        {:ok, s.module.status(s.live, name)}

      {:ok, command} ->
        s.module.command(s.live, command)

      {:error, line} ->
        {:error, line}
    end
  end
end
