defmodule Console.Terminal.Session do
  @moduledoc false
  # Shows a live fleet to a person: full screen on a terminal, plain lines elsewhere.
  #
  # One process waits for keys or lines and for the time to draw; the fleet runs beside it. It
  # decides nothing: `Console.Terminal` draws, `Console.Prompt` checks, `Console.Orders` has
  # orders carried out.
  alias Console.{Demo, Gamepad, Options, Orders, Pace, Page, Picture, Report, Teleop, Terminal}
  alias Console.Cli.{Format, Output}
  alias Console.Picture.RunTrack
  alias Console.Prompt
  alias Console.Terminal.Tty
  alias Console.Terminal.Editor
  alias Sim.Scene

  @draw_ms 100
  # A key is shown after this time, together with all that came meanwhile: pasted text comes fast.
  @key_ms 20
  @status_s 5

  @enforce_keys [:module, :live, :orders, :robots, :until_s, :mode, :output]
  defstruct @enforce_keys ++
              [
                view: nil,
                scene: nil,
                told: 0,
                status_s: 0,
                track: nil,
                started_ms: 0,
                ended: nil,
                redraw?: false,
                keys: nil,
                gamepad: nil,
                page: ["there is no page: --page off"]
              ]

  @doc "Runs until the time is up or a person quits; returns the exit status."
  @spec run(Options.t(), module(), (map() -> {:ok, pid()} | {:error, String.t()})) :: 0 | 1 | 2
  def run(%Options{} = options, module, start) do
    tty = Tty.open()
    until_s = until_s(options, tty)

    try do
      case start.(%{Options.trial(options) | duration_s: until_s || 86_400.0}) do
        {:ok, live} -> live(options, module, live, until_s, tty)
        {:error, line} -> refuse(line)
      end
    after
      with {:ok, saved} <- tty do
        IO.write(Terminal.leave())
        Tty.close(saved)
      end
    end
    |> finish(options)
  end

  defp until_s(%Options{duration_s: nil}, {:ok, _saved}), do: nil
  defp until_s(options, _tty), do: Options.duration_s(options)

  defp refuse(line), do: {:refused, line}

  defp live(options, module, live, until_s, tty) do
    Process.flag(:trap_exit, true)
    mode = if tty == :error, do: :lines, else: :screen
    reader = spawn_link(reader(mode, self()))
    scene = module.scene(live)
    me = self()
    giver = if mode == :screen, do: "terminal of #{node()}", else: "prompt of #{node()}"
    {:ok, orders} = Orders.start_link(giver, &send(me, {:answer, &1, &2}))

    session = %__MODULE__{
      module: module,
      live: live,
      orders: orders,
      robots: options.robots,
      scene: scene,
      until_s: until_s,
      mode: mode,
      output: Output.to(if(options.json == "-", do: :stderr, else: :stdio)),
      track: options.picture && RunTrack.new(scene),
      view: %Terminal{
        editor: %{Editor.new(&Prompt.completions(&1, options.robots)) | most: Prompt.most_bytes()}
      },
      started_ms: Hal.Clock.now_ms()
    }

    told = page(session, options)
    lines = if(Options.real_time?(options), do: module.lines(live), else: [])
    begin(session, options, lines ++ told)

    session = if told == [], do: session, else: %{session | page: told}

    session =
      cond do
        mode != :screen -> session
        # Else the processes would not be shown.
        options.nodes -> show(session, lines ++ told)
        true -> Enum.reduce(told, session, &answer(&2, &1, :dim))
      end

    send(self(), :draw)
    session = loop(session)
    Process.unlink(reader)
    Process.exit(reader, :kill)
    :ok = Orders.settle(orders)
    answers(session)
  end

  # What was ordered before the end is answered before it.
  defp answers(session) do
    receive do
      {:answer, line, answer} -> session |> answered(line, answer) |> answers()
    after
      0 -> session
    end
  end

  # The page and its like are more views; without them the demo goes on.
  defp page(%{module: module, live: live}, options) do
    served = [
      module: module,
      live: live,
      robots: options.robots,
      address: options.page_address,
      token: options.page_token,
      origin: options.page_origin
    ]

    page(served, options.page) ++ Page.Service.start(options.services, served)
  end

  defp page(_served, :off), do: []

  defp page(served, port) do
    case Page.start_link([port: port] ++ served) do
      {:ok, _page, url} -> ["Page:  " <> url]
      {:error, line} -> ["no page: " <> line]
    end
  end

  # Before the full screen, so that they can still be read after it.
  defp begin(%{mode: :screen} = session, _options, lines) do
    Enum.each(lines, &Output.line(session.output, &1))
    IO.write(Terminal.enter())
  end

  defp begin(session, options, lines) do
    Enum.each([Demo.heading(options, session.scene) | lines], &Output.line(session.output, &1))
    Output.line(session.output, Terminal.hint(session.scene.mission))
  end

  # Reading waits, so it has a process of its own.
  defp reader(:screen, session), do: fn -> keys(session) end
  defp reader(:lines, session), do: fn -> lines(session) end

  defp keys(session) do
    case IO.getn("", 1) do
      key when is_binary(key) ->
        send(session, {:key, key, now_us()})
        keys(session)

      _closed ->
        send(session, :quit)
    end
  end

  defp lines(session) do
    case IO.gets("") do
      line when is_binary(line) ->
        send(session, {:line, line, now_us()})
        lines(session)

      _closed ->
        :ok
    end
  end

  defp now_us, do: System.monotonic_time(:microsecond)

  defp loop(%{live: live, orders: orders} = session) do
    receive do
      :draw ->
        scene = session.module.scene(live)
        pace = session.module.pace(live)
        session = put_in(session.view.pace, pace && Pace.words(pace))
        session = %{session | scene: scene} |> draw(scene) |> tell(scene) |> track(scene)

        cond do
          line = session.module.ended(live) ->
            %{session | ended: line}

          session.until_s && scene.at_ms >= session.until_s * 1000 ->
            session

          true ->
            Process.send_after(self(), :draw, @draw_ms)
            loop(session)
        end

      {:key, key, given_us} ->
        session |> key(key, given_us) |> continue()

      # Draws the scene at hand, because typing must not wait for the fleet.
      :redraw ->
        loop(draw(%{session | redraw?: false}, session.scene))

      {:line, line, given_us} ->
        session |> obey(line, given_us) |> continue()

      {:answer, line, answer} ->
        session |> answered(line, answer) |> redraw() |> continue()

      {:gamepad, line} ->
        session |> answer(line, :bad) |> continue()

      :quit ->
        session

      {:EXIT, ^live, reason} ->
        exit({:fleet_died, reason})

      {:EXIT, ^orders, reason} ->
        exit({:orders_died, reason})

      {:EXIT, pad, _reason} when pad == session.gamepad ->
        loop(%{session | gamepad: nil})

      {:EXIT, _reader, _reason} ->
        loop(session)
    end
  end

  defp continue({:quit, session}), do: session
  defp continue(session), do: loop(session)

  # While a robot is driven its keys are no text.
  defp key(%{keys: %Teleop.Keys{}} = session, key, given_us) do
    {event, keys} = Teleop.Keys.key(session.keys, key)
    session = drive(session, keys)

    case event do
      nil -> session
      :speed -> redraw(session)
      :estop -> session |> drive(nil) |> obey("estop", given_us) |> redraw()
      :leave -> session |> drive(nil) |> word(keys.robot, {0.0, 0.0}, given_us) |> redraw()
      {:word, stick} -> session |> word(keys.robot, stick, given_us) |> redraw()
    end
  end

  defp key(session, key, given_us) do
    {event, editor} = Editor.key(session.view.editor, key)
    session = put_in(session.view.editor, editor)

    case event do
      nil -> redraw(session)
      :quit -> {:quit, session}
      :estop -> session |> obey("estop", given_us) |> redraw()
      {:choices, words} -> session |> answer(Enum.join(words, "  "), :dim) |> redraw()
      {:line, line} -> session |> entered(line, given_us) |> redraw()
    end
  end

  # Enter alone turns the page.
  defp entered(%{view: %{overlay: [_ | _]} = view} = session, line, given_us) do
    if String.trim(line) == "",
      do: %{session | view: Terminal.turn(view)},
      else: obey(%{session | view: %{view | overlay: nil}}, line, given_us)
  end

  defp entered(session, line, given_us), do: obey(session, line, given_us)

  defp drive(session, keys),
    do: put_in(%{session | keys: keys}.view.driving, keys && Teleop.Keys.hint(keys))

  defp word(session, robot, stick, given_us) do
    order = Orders.of_word(robot, stick, :terminal, {session.module, session.live}, given_us)
    Orders.give(session.orders, order)
    session
  end

  defp gamepad(%{gamepad: pad} = session, :off) do
    if pad, do: Process.exit(pad, :shutdown)
    {%{session | gamepad: nil}, if(pad, do: "off", else: "there was none")}
  end

  defp gamepad(session, {robot, path}) do
    {session, _off} = gamepad(session, :off)
    me = self()
    told = [robot: robot, path: path, tell: &send(me, {:gamepad, &1})]

    case Gamepad.start_link([module: session.module, live: session.live] ++ told) do
      {:ok, pad} -> {%{session | gamepad: pad}, "hold a shoulder button, and drive by the stick"}
      {:error, line} -> {:error, line}
    end
  end

  defp redraw({:quit, session}), do: {:quit, session}
  defp redraw(%{mode: :lines} = session), do: session
  defp redraw(%{redraw?: true} = session), do: session

  defp redraw(session) do
    Process.send_after(self(), :redraw, @key_ms)
    %{session | redraw?: true}
  end

  defp draw(%{mode: :lines} = session, _scene), do: session

  defp draw(session, scene) do
    {columns, rows} = Tty.size()
    {text, view} = Terminal.frame(scene, %{session.view | columns: columns, rows: rows})
    IO.write(text)
    %{session | view: view}
  end

  defp tell(%{mode: :screen} = session, _scene), do: session

  defp tell(session, scene) do
    new = Scene.news(scene.stages, session.told)
    Enum.each(new, &Output.line(session.output, Format.stage(&1)))
    session = %{session | told: Scene.told(scene.stages)}

    if scene.at_ms >= session.status_s * 1000 do
      Output.line(session.output, Format.status(scene))
      %{session | status_s: div(scene.at_ms, 1000) + @status_s}
    else
      session
    end
  end

  defp track(%{track: nil} = session, _scene), do: session
  defp track(session, scene), do: %{session | track: RunTrack.add(session.track, scene)}

  defp obey(session, line, given_us) do
    case Prompt.parse(line, session.robots) do
      {:ok, :nothing} ->
        session

      {:ok, :quit} ->
        {:quit, session}

      {:ok, :help} ->
        show(session, Prompt.help(offers(session)))

      {:ok, {:drive, robot}} when session.mode == :screen ->
        drive(session, Teleop.Keys.new(robot))

      {:ok, {:drive, _robot}} ->
        answer(session, "drive needs a terminal", :bad)

      {:ok, {:gamepad, whom}} ->
        case gamepad(session, whom) do
          {:error, error} -> answer(session, error, :bad)
          {session, text} -> answer(session, "#{String.trim(line)}: #{text}", :good)
        end

      {:ok, :nodes} ->
        show(session, session.module.lines(session.live) ++ session.page)

      {:ok, :page} ->
        Enum.reduce(session.page, session, &answer(&2, &1, :good))

      {:ok, :status} ->
        show(session, Format.everybody(session.module.scene(session.live)))

      {:ok, {:status, name}} ->
        show(session, Format.one(session.module.scene(session.live), name))

      {:ok, command} ->
        source = {session.module, session.live}
        Orders.give(session.orders, Orders.of_line(line, command, source, given_us))
        session

      {:error, error} ->
        answer(session, error, :bad)
    end
  end

  defp offers(%{module: module, live: live}) do
    if function_exported?(module, :offers, 1), do: module.offers(live), else: []
  end

  defp answered(session, line, {:ok, text}), do: answer(session, "#{line}: #{text}", :good)
  defp answered(session, _line, {:error, error}), do: answer(session, error, :bad)

  defp answer(%{mode: :lines} = session, text, _style) do
    Output.line(session.output, text)
    session
  end

  defp answer(session, text, style),
    do: update_in(session.view.messages, &Enum.take([{text, style} | &1], 4))

  defp show(%{mode: :lines} = session, lines) do
    Enum.each(lines, &Output.line(session.output, &1))
    session
  end

  defp show(session, lines), do: %{session | view: Terminal.show(session.view, lines)}

  # Printed after the terminal is restored.
  defp finish({:refused, line}, _options) do
    IO.puts(:stderr, "demo: #{line}")
    1
  end

  defp finish(session, options) do
    result = session.module.result(session.live)
    formed? = session.module.scene(session.live).formed?
    wall_s = (Hal.Clock.now_ms() - session.started_ms) / 1000
    Enum.each(Report.summary(result, formed?, wall_s), &Output.line(session.output, &1))

    drawing =
      session.track &&
        fn -> Picture.draw(session.track, Picture.title(Options.trial(options))) end

    session.module.stop(session.live)

    case Report.write(options, Report.json(result, wall_s), drawing, session.output) do
      :ok when session.ended != nil -> refuse(session.ended) |> finish(options)
      :ok -> if formed? or session.until_s == nil, do: 0, else: 2
      {:error, line} -> refuse(line) |> finish(options)
    end
  end
end
