defmodule Console.Cli.Output do
  @moduledoc """
  Prints the output of a command: plain lines, and on a terminal a progress line that is redrawn
  below them.
  """
  alias Console.Cli.{OutFile, Progress}

  # How often the progress line is redrawn.
  @period_ms 100
  @clear "\r\e[K"

  @enforce_keys [:device, :columns]
  defstruct @enforce_keys

  @type t :: %__MODULE__{device: IO.device(), columns: pos_integer() | nil}

  @doc "The output to a device; `columns` is `nil` if it is not a terminal."
  @spec to(:stdio | :stderr) :: t()
  def to(device), do: %__MODULE__{device: device, columns: columns(device)}

  @doc "The width of the terminal behind a device, or `nil`."
  @spec columns(:stdio | :stderr) :: pos_integer() | nil
  def columns(device) do
    case :io.columns(if(device == :stdio, do: :standard_io, else: :standard_error)) do
      {:ok, columns} when columns > 0 -> columns
      _no_terminal -> nil
    end
  end

  @doc "Prints a line that stays."
  @spec line(t(), String.t()) :: :ok
  def line(%__MODULE__{columns: nil} = output, text), do: IO.puts(output.device, text)
  def line(%__MODULE__{} = output, text), do: IO.puts(output.device, @clear <> text)

  @doc "Prints a line that the next one replaces; prints nothing if there is no terminal."
  @spec progress(t(), String.t()) :: :ok
  def progress(%__MODULE__{columns: nil}, _text), do: :ok
  def progress(%__MODULE__{} = output, text), do: IO.write(output.device, @clear <> text)

  @doc """
  Redraws the progress line of a view, which keeps an `output` and the last `drawn_ms`, ten times a second at most;
  `shown` says what is done of all, and a note.
  """
  @spec redraw(view, (... -> {number(), number(), String.t()})) :: view
        when view: %{:output => t(), :drawn_ms => integer(), optional(atom()) => term()}
  def redraw(%{output: %__MODULE__{columns: nil}} = view, _shown), do: view

  def redraw(%{output: output} = view, shown) do
    now_ms = Hal.Clock.now_ms()

    if now_ms - view.drawn_ms >= @period_ms do
      {done, all, note} = shown.()
      progress(output, Progress.line(done, all, note, output.columns - 1))
      %{view | drawn_ms: now_ms}
    else
      view
    end
  end

  @doc "Removes the progress line."
  @spec finish(t()) :: :ok
  def finish(output), do: progress(output, "")

  @doc "Writes a term to the file that `--json` names, if any; the error is for people."
  @spec json(Path.t() | nil, term()) :: :ok | {:error, [String.t()]}
  def json(nil, _term), do: :ok

  def json(path, term) do
    with {:error, line} <- OutFile.write("--json", path, [Hal.Json.encode!(term), "\n"]),
         do: {:error, [line]}
  end
end
