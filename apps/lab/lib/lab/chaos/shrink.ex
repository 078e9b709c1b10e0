defmodule Lab.Chaos.Shrink do
  @moduledoc false
  # Looks for the smallest run that is still wrong. Pure; the same run and judge give the same result.
  #
  # What is taken away, in this order, again and again until nothing more can be: time after the
  # violation, events, robots with the events that name them, loss, copies, delays, noise, and whatever
  # else differs from the defaults. Each smaller run is judged; one that is still wrong replaces the
  # larger one.

  @typedoc "When a run is wrong, in milliseconds; `nil` if it is not, or cannot be made."
  @type judge :: (keyword() -> non_neg_integer() | nil)

  @events [:script, :cuts, :moves, :kills]
  @plain [
    loss: 0.0,
    duplicates: 0.0,
    delay_ms: {5, 50},
    noise: :off,
    noise: :default,
    blobs: :direct,
    casts: :sent,
    start: :spread,
    lost_link: nil,
    policy: :available,
    leader_change: true,
    assign: :cost,
    formation: {:column, 1.0},
    landmark: :default,
    map: "hall"
  ]

  @doc """
  The smallest run found with at most so many judgements, and how many were needed.

      iex> wrong? = fn run -> if :mag2 in run[:robots] and run[:loss] > 0, do: 3_200 end
      iex> run = [robots: [:mag1, :mag2, :min1], kills: [{:mag1, 9}], loss: 0.3, duration_s: 60]
      iex> Lab.Chaos.Shrink.shrink(run, wrong?, 50) |> elem(0)
      [robots: [:mag2], kills: [], loss: 0.3, duration_s: 4]
  """
  @spec shrink(keyword(), judge(), attempts :: non_neg_integer()) ::
          {keyword(), needed :: non_neg_integer()}
  def shrink(run, judge, attempts) do
    state = %{run: run, judge: judge, left: attempts, tried: MapSet.new([run])}
    state = rounds(state)
    {state.run, attempts - state.left}
  end

  defp rounds(%{left: 0} = state), do: state

  defp rounds(%{run: run} = state) do
    state = state |> exhaust(&events/1) |> exhaust(&robots/1) |> exhaust(&plain/1)
    if state.run == run, do: state, else: rounds(state)
  end

  # The first candidate that is still wrong replaces the run, and there are new ones.
  defp exhaust(state, candidates) do
    case Enum.reduce_while(candidates.(state.run), state, &attempt/2) do
      {:smaller, state} -> exhaust(state, candidates)
      state -> state
    end
  end

  defp attempt(_candidate, %{left: 0} = state), do: {:halt, state}

  defp attempt(candidate, state) do
    if MapSet.member?(state.tried, candidate) do
      {:cont, state}
    else
      state = %{state | left: state.left - 1, tried: MapSet.put(state.tried, candidate)}

      case state.judge.(candidate) do
        nil -> {:cont, state}
        at_ms -> {:halt, {:smaller, shorten(%{state | run: candidate}, at_ms)}}
      end
    end
  end

  # Nothing after the violation matters. Events that would come later go, too; but the run is judged
  # again, because what is judged at its end changes with its end.
  defp shorten(state, at_ms) do
    until_s = div(at_ms, 1000) + 1
    run = state.run |> over(until_s) |> Keyword.replace(:duration_s, until_s)

    if run[:duration_s] >= state.run[:duration_s] or state.left == 0 or
         MapSet.member?(state.tried, run) do
      state
    else
      state = %{state | left: state.left - 1, tried: MapSet.put(state.tried, run)}
      if state.judge.(run), do: %{state | run: run}, else: state
    end
  end

  defp over(run, until_s) do
    Enum.map(run, fn
      {key, events} when key in @events ->
        {key, Enum.filter(events, &(begins_s(key, &1) < until_s))}

      other ->
        other
    end)
  end

  defp begins_s(key, event) when key in [:moves, :kills], do: elem(event, 1)
  defp begins_s(_key, event), do: elem(event, 0)

  # All of a kind, then each by itself, the last first.
  defp events(run) do
    for key <- @events,
        events = Keyword.get(run, key, []),
        events != [],
        fewer <- [[] | for(k <- (length(events) - 1)..0//-1, do: List.delete_at(events, k))],
        uniq: true,
        do: Keyword.replace(run, key, fewer)
  end

  # One half, the other half, then each by itself, the last first.
  defp robots(run) do
    robots = run[:robots]
    {left, right} = Enum.split(robots, div(length(robots) + 1, 2))
    fewer = [left, right | for(k <- (length(robots) - 1)..0//-1, do: List.delete_at(robots, k))]
    for some <- fewer, some != [], some != robots, uniq: true, do: keep(run, some)
  end

  defp keep(run, robots) do
    gone = run[:robots] -- robots

    Enum.map(run, fn
      {:robots, _all} -> {:robots, robots}
      {:cuts, cuts} -> {:cuts, for(cut <- cuts, cut = cut(cut, gone), do: cut)}
      {key, events} when key in @events -> {key, Enum.reject(events, &names?(&1, gone))}
      other -> other
    end)
  end

  defp cut({from_s, to_s, groups}, gone) when is_list(groups) do
    case for group <- groups, (left = group -- gone) != [], do: left do
      [_, _ | _] = groups -> {from_s, to_s, groups}
      _one_or_none -> nil
    end
  end

  defp cut(cut, gone), do: unless(names?(cut, gone), do: cut)

  defp names?(term, gone) when is_atom(term), do: term in gone
  defp names?(term, gone) when is_tuple(term), do: term |> Tuple.to_list() |> names?(gone)
  defp names?(term, gone) when is_list(term), do: Enum.any?(term, &names?(&1, gone))
  defp names?(_other, _gone), do: false

  defp plain(run) do
    for {key, value} <- @plain, Keyword.has_key?(run, key), plainer?(run[key], value) do
      Keyword.replace(run, key, value)
    end
  end

  # Both kinds of less noise are tried, but none is exchanged for more.
  defp plainer?(:off, :default), do: false
  defp plainer?(is, plain), do: is != plain
end
