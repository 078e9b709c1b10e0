defmodule Vision.View.Subscribers do
  @moduledoc """
  Keeps the viewers of a camera: which of them wait for a picture, and when the next one is due.
  Pure; times are integer milliseconds.

  A viewer gets one picture for each request, and not faster than its rate. One that does not ask,
  because it is slow or hangs, gets nothing, costs nothing, and gets the newest picture when it
  asks again.
  """

  @enforce_keys [:most]
  defstruct @enforce_keys ++ [viewers: %{}]

  @type id :: term()
  @opaque t :: %__MODULE__{most: pos_integer(), viewers: %{id() => map()}}

  @doc "No viewers, and at most `most` later."
  @spec new(most :: pos_integer()) :: t()
  def new(most), do: %__MODULE__{most: most}

  @doc """
  Adds a viewer, which waits for its first picture: it gets one every `every_ms` milliseconds at
  most, or one `:once`.

      iex> alias Vision.View.Subscribers
      iex> {:ok, subscribers} = Subscribers.join(Subscribers.new(1), :me, 200, 1_000)
      iex> Subscribers.due(subscribers, 1_000)
      0
      iex> {[:me], subscribers} = Subscribers.serve(subscribers, 1_050)
      iex> Subscribers.due(subscribers, 1_050)
      :never
      iex> subscribers |> Subscribers.ask(:me) |> Subscribers.due(1_100)
      100
      iex> Subscribers.join(subscribers, :you, :once, 1_100)
      {:error, :full}
  """
  @spec join(t(), id(), every_ms :: pos_integer() | :once, now_ms :: integer()) ::
          {:ok, t()} | {:error, :full}
  def join(%__MODULE__{viewers: viewers, most: most}, _id, _every, _now)
      when map_size(viewers) >= most,
      do: {:error, :full}

  def join(subscribers, id, every, now_ms) do
    viewer = %{every: every, next_ms: now_ms, waits?: true}
    {:ok, put_in(subscribers.viewers[id], viewer)}
  end

  @doc """
  Takes a viewer's request for its next picture. Another one before that picture changes nothing.
  """
  @spec ask(t(), id()) :: t()
  def ask(%__MODULE__{viewers: viewers} = subscribers, id) do
    case viewers do
      %{^id => viewer} -> %{subscribers | viewers: %{viewers | id => %{viewer | waits?: true}}}
      _gone -> subscribers
    end
  end

  @doc "Removes a viewer."
  @spec leave(t(), id()) :: t()
  def leave(%__MODULE__{viewers: viewers} = subscribers, id),
    do: %{subscribers | viewers: Map.delete(viewers, id)}

  @doc "Whether this is a viewer."
  @spec member?(t(), id()) :: boolean()
  def member?(%__MODULE__{viewers: viewers}, id), do: is_map_key(viewers, id)

  @doc "The viewers, in no particular order."
  @spec ids(t()) :: [id()]
  def ids(%__MODULE__{viewers: viewers}), do: Map.keys(viewers)

  @doc "The number of viewers."
  @spec size(t()) :: non_neg_integer()
  def size(%__MODULE__{viewers: viewers}), do: map_size(viewers)

  @doc "In how many milliseconds a picture is due; `:never` while none waits for one."
  @spec due(t(), now_ms :: integer()) :: non_neg_integer() | :never
  def due(%__MODULE__{viewers: viewers}, now_ms) do
    case for {_id, %{waits?: true, next_ms: next_ms}} <- viewers, do: next_ms do
      [] -> :never
      times -> max(0, Enum.min(times) - now_ms)
    end
  end

  @doc """
  Takes a picture; returns the viewers that get it. A viewer's next picture is counted from when
  this one was due, so that a camera that gives its frames somewhat late does not slow the viewer
  down.
  """
  @spec serve(t(), now_ms :: integer()) :: {[id()], t()}
  def serve(%__MODULE__{viewers: viewers} = subscribers, now_ms) do
    ids = for {id, %{waits?: true, next_ms: next}} <- viewers, next <= now_ms, do: id
    {ids, %{subscribers | viewers: Enum.reduce(ids, viewers, &served(&1, &2, now_ms))}}
  end

  defp served(id, viewers, now_ms) do
    case viewers[id] do
      %{every: :once} ->
        Map.delete(viewers, id)

      %{every: every, next_ms: next_ms} = viewer ->
        next_ms = max(next_ms + every, now_ms + div(every, 2))
        %{viewers | id => %{viewer | waits?: false, next_ms: next_ms}}
    end
  end
end
