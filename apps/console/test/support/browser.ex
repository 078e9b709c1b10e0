defmodule Console.Browser do
  @moduledoc "A real browser for tests: Debian's chromium, by its driver, in the words of W3C's WebDriver."
  alias Hal.Json

  @enforce_keys [:port, :session]
  defstruct @enforce_keys

  @flags ~w(--headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage --force-prefers-reduced-motion)

  @doc "Why there is no browser here, or `nil`."
  @spec why_not() :: String.t() | nil
  def why_not do
    Enum.find_value(~w(chromium chromedriver), fn name ->
      unless System.find_executable(name), do: "#{name} is not installed"
    end)
  end

  # No window is narrower; a page that shall be is shown as on a phone.
  @narrowest 500

  @doc "A browser with a window of this size; it ends with the test's process."
  @spec open({pos_integer(), pos_integer()}, [String.t()]) :: %__MODULE__{}
  def open({width, height}, flags \\ []) do
    {:ok, _apps} = Application.ensure_all_started(:inets)
    port = driver()

    options = %{
      "args" => ["--window-size=#{width},#{height}" | flags] ++ @flags,
      "binary" => System.find_executable("chromium")
    }

    metrics = %{"width" => width, "height" => height, "pixelRatio" => 1}

    options =
      if width < @narrowest,
        do: Map.put(options, "mobileEmulation", %{"deviceMetrics" => metrics}),
        else: options

    wanted = %{"goog:chromeOptions" => options, "goog:loggingPrefs" => %{"browser" => "ALL"}}

    %{"sessionId" => session} =
      ask(port, :post, "/session", %{capabilities: %{alwaysMatch: wanted}})

    %__MODULE__{port: port, session: session}
  end

  # It ends when its standard input does.
  defp driver do
    script = ~s(chromedriver --port=0 & p=$!; read _end; kill $p)
    args = ["-c", script]
    port = Port.open({:spawn_executable, "/bin/sh"}, [:binary, :stderr_to_stdout, args: args])
    listening(port, "")
  end

  defp listening(port, said) do
    receive do
      {^port, {:data, more}} ->
        said = said <> more

        case Regex.run(~r/started successfully on port (\d+)|Address already in use/, said) do
          [_all, number] -> number
          # It chose a port for both families, and another program was faster on one of them.
          [_taken] -> driver()
          nil -> listening(port, said)
        end
    after
      30_000 -> raise "chromedriver does not start: #{said}"
    end
  end

  @doc "Ends it."
  def close(browser), do: command(browser, :delete, "", nil)

  @doc "Opens a page."
  def go(browser, url), do: command(browser, :post, "/url", %{url: url})

  @doc "What a piece of JavaScript returns."
  def run(browser, script),
    do: command(browser, :post, "/execute/sync", %{script: script, args: []})

  @doc "What the page and the browser have complained of since the last look."
  def errors(browser) do
    for %{"level" => "SEVERE", "message" => message} <-
          command(browser, :post, "/se/log", %{type: "browser"}),
        do: message
  end

  @doc "A picture of the window, as PNG."
  def picture(browser), do: browser |> command(:get, "/screenshot", nil) |> Base.decode64!()

  @doc "Presses the pointer at the first place, moves it over the others, and lets go; pixels from the window's corner."
  def drag(browser, [{x, y} | places]) do
    move = &%{type: "pointerMove", duration: 50, x: round(elem(&1, 0)), y: round(elem(&1, 1))}

    deeds =
      [move.({x, y}), %{type: "pointerDown", button: 0}] ++
        Enum.map(places, move) ++ [%{type: "pointerUp", button: 0}]

    command(browser, :post, "/actions", %{
      actions: [%{type: "pointer", id: "mouse", actions: deeds}]
    })
  end

  @doc "Holds a key down, or lets it go."
  def key(browser, kind, key) when kind in [:keyDown, :keyUp],
    do:
      command(browser, :post, "/actions", %{
        actions: [%{type: "key", id: "keys", actions: [%{type: kind, value: key}]}]
      })

  @doc """
  A key event as a keyboard makes it, by the words of Chrome's DevTools (`Input.dispatchKeyEvent`): which key (`code`),
  what it writes (`key`), whether it repeats (`autoRepeat`), and `modifiers` (1 Alt, 2 Ctrl, 4 Meta, 8 Shift).
  """
  @spec keyboard(%__MODULE__{}, :down | :up, keyword()) :: term()
  def keyboard(browser, kind, event) do
    type = if kind == :down, do: "rawKeyDown", else: "keyUp"
    tools(browser, "Input.dispatchKeyEvent", event |> Map.new() |> Map.put(:type, type))
  end

  @doc "A pointer event, by the words of Chrome's DevTools (`Input.dispatchMouseEvent`)."
  @spec mouse(%__MODULE__{}, String.t(), keyword()) :: term()
  def mouse(browser, type, event),
    do: tools(browser, "Input.dispatchMouseEvent", event |> Map.new() |> Map.put(:type, type))

  @doc "What fingers do: `touchStart`, `touchMove` or `touchEnd`, with the fingers that are down then, as `{id, x, y}`."
  @spec touch(%__MODULE__{}, String.t(), [{integer(), number(), number()}]) :: term()
  def touch(browser, type, fingers) do
    points = for {id, x, y} <- fingers, do: %{id: id, x: x, y: y}
    tools(browser, "Input.dispatchTouchEvent", %{type: type, touchPoints: points})
  end

  @doc "Lets nothing load whose address is like one of these (`*/page.js`)."
  @spec block(%__MODULE__{}, [String.t()]) :: term()
  def block(browser, addresses) do
    tools(browser, "Network.enable", %{})
    tools(browser, "Network.setBlockedURLs", %{urls: addresses})
  end

  defp tools(browser, method, params),
    do: command(browser, :post, "/goog/cdp/execute", %{cmd: method, params: params})

  @doc "Answers the dialog that the page shows."
  @spec dialog(%__MODULE__{}, :accept | :dismiss) :: term()
  def dialog(browser, answer), do: command(browser, :post, "/alert/#{answer}", %{})

  @doc "Opens another tab in front of the page, and closes it again. Commands go to the page all the time."
  @spec elsewhere(%__MODULE__{}) :: term()
  def elsewhere(browser) do
    page = command(browser, :get, "/window", nil)
    %{"handle" => other} = command(browser, :post, "/window/new", %{type: "tab"})
    command(browser, :post, "/window", %{handle: other})
    command(browser, :delete, "/window", nil)
    command(browser, :post, "/window", %{handle: page})
  end

  # As WebDriver writes them.
  @keys %{tab: "\uE004", enter: "\uE007", left: "\uE012", down: "\uE015", f8: "\uE038"}

  @doc "Presses keys one after the other: letters, or `:tab`, `:enter`, `:left`, `:down`, `:f8`."
  @spec press(%__MODULE__{}, [String.t() | atom()]) :: term()
  def press(browser, keys) do
    actions =
      for key <- keys,
          type <- [:keyDown, :keyUp],
          do: %{type: type, value: Map.get(@keys, key, key)}

    command(browser, :post, "/actions", %{actions: [%{type: "key", id: "keys", actions: actions}]})
  end

  @doc "Waits until a piece of JavaScript returns something true; returns that."
  def await(browser, script, left \\ 300) do
    case run(browser, script) do
      nothing when nothing in [nil, false] and left > 0 ->
        receive(do: (:never -> :ok), after: (50 -> await(browser, script, left - 1)))

      nothing when nothing in [nil, false] ->
        raise "in vain: #{script}; the page says: #{run(browser, "return document.body.innerText")}"

      value ->
        value
    end
  end

  defp command(%{port: port, session: session}, method, path, body),
    do: ask(port, method, "/session/#{session}" <> path, body)

  defp ask(port, method, path, body) do
    url = String.to_charlist("http://127.0.0.1:#{port}#{path}")
    request = if body, do: {url, [], ~c"application/json", Json.encode!(body)}, else: {url, []}

    # Without certificates of its own, a system makes newer Erlang fall at its default for `ssl`.
    {:ok, {{_http, status, _reason}, _headers, text}} =
      :httpc.request(method, request, [timeout: 60_000, ssl: []], body_format: :binary)

    %{"value" => value} = text |> Mcap.Json.decode!() |> plain()
    status == 200 || raise "#{method} #{path}: #{status}: #{inspect(value)}"
    value
  end

  defp plain({:object, pairs}), do: Map.new(pairs, fn {key, value} -> {key, plain(value)} end)
  defp plain(values) when is_list(values), do: Enum.map(values, &plain/1)
  defp plain(value), do: value
end
