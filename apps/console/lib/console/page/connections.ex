defmodule Console.Page.Connections do
  @moduledoc false
  # Decides which connections of the page stay. Pure; time in ms.
  #
  # A person who has lost the page needs it at once: it has the stop button. So the newest connection is always let in, and
  # an older one ends for it. Strangers, which have not made a whole request that the page answers (with its token, where
  # it has one), end only each other, and first those of the address that has most of them: silence, however much, keeps
  # none out and ends no page that is open.
  #
  # | state | since | how long |
  # |---|---|---|
  # | `:stranger` | it was accepted | 2 s |
  # | `:busy` | its request was whole | 30 s |
  # | `:idle` | its last answer was sent | 15 s |
  # | `:live` (a WebSocket) | its last word: of the page, or of the browser, which answers each ping | 20 s |

  @longest_ms %{stranger: 2_000, busy: 30_000, idle: 15_000, live: 20_000}
  @most_strangers 200
  @most_known 200

  defstruct all: %{}

  @type state :: :stranger | :busy | :idle | :live
  @type t :: %__MODULE__{all: %{pid() => {:inet.ip_address(), state(), since_ms :: integer()}}}

  @doc "A stranger has come; returns the connections that end for it."
  @spec add(t(), pid(), :inet.ip_address(), integer()) :: {t(), [pid()]}
  def add(connections, pid, address, now_ms),
    do: connections |> put(pid, {address, :stranger, now_ms}) |> crowded()

  @doc "What a connection does from now on; one that has ended does nothing."
  @spec note(t(), pid(), state(), integer()) :: {t(), [pid()]}
  def note(connections, pid, state, now_ms) do
    case connections.all do
      %{^pid => {address, _was, _since_ms}} ->
        connections |> put(pid, {address, state, now_ms}) |> crowded()

      _ended ->
        {connections, []}
    end
  end

  @doc "Where a connection comes from; `nil` if it has ended."
  @spec address(t(), pid()) :: :inet.ip_address() | nil
  def address(%{all: all}, pid) do
    with {address, _state, _since_ms} <- all[pid], do: address
  end

  @doc "Those whose time is over."
  @spec overdue(t(), integer()) :: {t(), [pid()]}
  def overdue(connections, now_ms) do
    late =
      for {pid, {_address, state, since_ms}} <- connections.all,
          now_ms - since_ms > @longest_ms[state],
          do: pid

    {drop(connections, late), late}
  end

  @doc "They have ended."
  @spec drop(t(), [pid()]) :: t()
  def drop(connections, pids), do: %{connections | all: Map.drop(connections.all, pids)}

  defp put(connections, pid, one), do: %{connections | all: Map.put(connections.all, pid, one)}

  defp crowded(connections) do
    {strangers, known} =
      Enum.split_with(connections.all, &match?({_pid, {_address, :stranger, _since_ms}}, &1))

    late = if length(strangers) > @most_strangers, do: [oldest(strangers)], else: []
    late = if length(known) > @most_known, do: [least(known) | late], else: late
    {drop(connections, late), late}
  end

  # A browser loses nothing with a connection that waits for its next request.
  defp least(known) do
    Enum.find_value([:idle, :live, :busy], fn state ->
      case Enum.filter(known, &match?({_pid, {_address, ^state, _since_ms}}, &1)) do
        [] -> nil
        some -> oldest(some)
      end
    end)
  end

  # Of the address that has most.
  defp oldest(connections) do
    counts = Enum.frequencies_by(connections, fn {_pid, {address, _, _}} -> address end)

    {pid, _one} =
      Enum.min_by(connections, fn {_pid, {address, _state, since_ms}} ->
        {-counts[address], since_ms}
      end)

    pid
  end
end
