defmodule Lab.Node.Log do
  @moduledoc """
  Writes a node's log: a file of lines `{microseconds, who, kind, value}` by the machine's time (CLOCK_MONOTONIC), which all
  namespaces share, whole up to the moment in which somebody kills the node; the first is `:boot`, with the number
  of the process of the operating system. Reads such files while they are written.
  """
  use GenServer
  alias Hal.Ticker

  @look_ms 100
  @most_bytes 10_000_000

  @typedoc "A kind of line: written each n-th tenth of a second, by `:change` only when it is another value than before."
  @type look ::
          {kind :: term(), n :: pos_integer(), :change | :always, {module(), atom(), list()}}
  @type line :: {us :: integer(), who :: atom(), kind :: atom(), value :: term()}
  @type offsets :: %{atom() => non_neg_integer()}

  @doc "Starts the log of a node in `folder`, as `WHO.log`. `begin` is called first, in its process."
  @spec start_link({Path.t(), who :: atom(), [look()], begin :: (... -> term()) | nil}) ::
          GenServer.on_start()
  def start_link({folder, who, looks, begin}) do
    path = Path.join(folder, "#{who}.log")
    GenServer.start_link(__MODULE__, {path, who, looks, begin}, name: __MODULE__)
  end

  @doc "The machine's time, in microseconds."
  @spec now() :: integer()
  def now, do: :os.perf_counter(:microsecond)

  @doc "Writes a line."
  @spec note(atom(), term()) :: :ok
  def note(kind, value), do: GenServer.cast(__MODULE__, {:always, now(), kind, value})

  @doc "Writes a line, if the value is another than the last one of its kind."
  @spec change(atom(), term()) :: :ok
  def change(kind, value), do: GenServer.cast(__MODULE__, {:change, now(), kind, value})

  @doc "What these have written into their logs since the last call, by time, and where to go on."
  @spec read(Path.t(), [atom()], offsets()) :: {[line()], offsets()}
  def read(folder, names, offsets) do
    {lines, offsets} =
      Enum.flat_map_reduce(names, offsets, fn who, offsets ->
        {lines, size} = news(Path.join(folder, "#{who}.log"), Map.get(offsets, who, 0))
        {lines, Map.put(offsets, who, size)}
      end)

    {Enum.sort_by(lines, &elem(&1, 0)), offsets}
  end

  # Only what is new in the file, and of that only whole lines.
  defp news(path, offset) do
    with {:ok, file} <- :file.open(path, [:read, :raw, :binary]) do
      text = with :eof <- pread(file, offset), do: ""
      :ok = :file.close(file)
      whole = text |> String.split("\n") |> Enum.drop(-1)
      {Enum.flat_map(whole, &parse/1), offset + Enum.sum(Enum.map(whole, &(byte_size(&1) + 1)))}
    else
      {:error, :enoent} -> {[], offset}
    end
  end

  defp pread(file, offset),
    do: with({:ok, text} <- :file.pread(file, offset, @most_bytes), do: text)

  # A node that is killed while it writes leaves half a line, to which the next life adds its first.
  defp parse(line) do
    with {:ok, tokens, _end} <- line |> String.to_charlist() |> :erl_scan.string(),
         {:ok, {_us, _who, _kind, _value} = line} <- :erl_parse.parse_term(tokens) do
      [line]
    else
      _half -> []
    end
  end

  @impl GenServer
  def init({path, who, looks, begin}) do
    Process.flag(:priority, :high)
    {:ok, file} = :file.open(path, [:append, :raw])
    if begin, do: begin.()
    ticker = Ticker.start(:look, @look_ms, 0)
    s = %{file: file, who: who, looks: looks, last: %{}, ticks: 0, ticker: ticker}
    {:ok, write(s, :always, now(), :boot, System.pid())}
  end

  @impl GenServer
  def handle_cast({how, us, kind, value}, s), do: {:noreply, write(s, how, us, kind, value)}

  @impl GenServer
  def handle_info(:look, s) do
    due = for {kind, n, how, mfa} <- s.looks, rem(s.ticks, n) == 0, do: {kind, how, mfa}

    s =
      Enum.reduce(due, s, fn {kind, how, {m, f, a}}, s ->
        write(s, how, now(), kind, apply(m, f, a))
      end)

    {:noreply, %{s | ticks: s.ticks + 1, ticker: Ticker.next(s.ticker)}}
  end

  defp write(%{last: last} = s, :change, _us, kind, value)
       when is_map_key(last, kind) and :erlang.map_get(kind, last) == value,
       do: s

  defp write(s, how, us, kind, value) do
    line = :io_lib.format("~0tp.~n", [{us, s.who, kind, value}])
    :ok = :file.write(s.file, :unicode.characters_to_binary(line))
    if how == :change, do: %{s | last: Map.put(s.last, kind, value)}, else: s
  end
end
