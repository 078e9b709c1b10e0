defmodule Vision.Saver.Retention do
  @moduledoc """
  Decides which pictures of one robot a folder keeps: the name of the next one, and which ones are
  deleted to make room. Pure. Names are `mag1-20260102T030405.678Z.jpg`, in UTC, so that they sort
  by time. If the clock is set back, the order is kept: the next name is then a millisecond after
  the last one.
  """

  @enforce_keys [:prefix, :files, :bytes]
  defstruct @enforce_keys ++ [kept: :queue.new(), count: 0, total: 0, last_ms: 0]

  @opaque t :: %__MODULE__{
            prefix: String.t(),
            files: pos_integer(),
            bytes: pos_integer(),
            kept: :queue.queue({String.t(), non_neg_integer()}),
            count: non_neg_integer(),
            total: non_neg_integer(),
            last_ms: integer()
          }

  @doc """
  The retention of pictures with this prefix, at most so many files and bytes; `there` is what the
  folder contains, as `{name, bytes}`.
  """
  @spec new(String.t(), pos_integer(), pos_integer(), [{String.t(), non_neg_integer()}]) :: t()
  def new(prefix, files, bytes, there) do
    retention = %__MODULE__{prefix: prefix, files: files, bytes: bytes}

    for({name, size} <- there, time_ms(prefix, name) != nil, do: {name, size})
    |> Enum.sort()
    |> Enum.reduce(retention, fn {name, size}, retention -> put(retention, name, size) end)
  end

  @doc """
  The name of the next picture; `now_ms` is the wall clock's time, in milliseconds since 1970.
  """
  @spec name(t(), now_ms :: integer()) :: String.t()
  def name(%__MODULE__{prefix: prefix, last_ms: last_ms}, now_ms) do
    {:ok, time} = DateTime.from_unix(max(now_ms, last_ms + 1), :millisecond)
    prefix <> Calendar.strftime(time, "-%Y%m%dT%H%M%S.%fZ.jpg")
  end

  @doc """
  The names that must be deleted, oldest first, to make room for a picture of this size; an error
  if the picture alone is too large.

      iex> alias Vision.Saver.Retention
      iex> retention = Retention.new("mag1", 2, 1_000, [])
      iex> one = Retention.name(retention, 1_767_323_045_678)
      "mag1-20260102T030405.678Z.jpg"
      iex> retention = Retention.put(retention, one, 600)
      iex> Retention.room(retention, 400)
      {:ok, [], retention}
      iex> {:ok, ["mag1-20260102T030405.678Z.jpg"], _shelf} = Retention.room(retention, 401)
      iex> Retention.room(retention, 1_001)
      {:error, :too_large}
  """
  @spec room(t(), size :: non_neg_integer()) :: {:ok, [String.t()], t()} | {:error, :too_large}
  def room(%__MODULE__{bytes: bytes}, size) when size > bytes, do: {:error, :too_large}

  def room(retention, size) do
    {gone, retention} = clear(retention, size, [])
    {:ok, Enum.reverse(gone), retention}
  end

  defp clear(%{count: count, total: total} = retention, size, gone) do
    if count >= retention.files or total + size > retention.bytes do
      {{:value, {name, bytes}}, kept} = :queue.out(retention.kept)

      clear(%{retention | kept: kept, count: count - 1, total: total - bytes}, size, [name | gone])
    else
      {gone, retention}
    end
  end

  @doc "Records that a picture of this name and size was saved; it is the newest."
  @spec put(t(), String.t(), size :: non_neg_integer()) :: t()
  def put(%__MODULE__{} = retention, name, size) do
    %{
      retention
      | kept: :queue.in({name, size}, retention.kept),
        count: retention.count + 1,
        total: retention.total + size,
        last_ms: max(retention.last_ms, time_ms(retention.prefix, name))
    }
  end

  @doc """
  When the picture of this name was saved; `nil` for a name that is not one of ours, which must
  not be deleted.

      iex> Vision.Saver.Retention.time_ms("mag1", "mag1-20260102T030405.678Z.jpg")
      1_767_323_045_678
      iex> Vision.Saver.Retention.time_ms("mag1", "mag1-holiday.jpg")
      nil
  """
  @spec time_ms(prefix :: String.t(), name :: String.t()) :: integer() | nil
  def time_ms(prefix, name) do
    with true <- String.starts_with?(name, prefix),
         {_prefix, <<?-, time::binary-size(20), ".jpg">>} <-
           :erlang.split_binary(name, byte_size(prefix)),
         <<y::binary-4, mo::binary-2, d::binary-2, ?T, h::binary-2, mi::binary-2, s::binary-2, ?.,
           ms::binary-3, ?Z>> <- time,
         {:ok, time, 0} <- DateTime.from_iso8601("#{y}-#{mo}-#{d}T#{h}:#{mi}:#{s}.#{ms}Z") do
      DateTime.to_unix(time, :millisecond)
    else
      _other -> nil
    end
  end

  @doc "How many pictures there are, and how many bytes."
  @spec size(t()) :: {files :: non_neg_integer(), bytes :: non_neg_integer()}
  def size(%__MODULE__{count: count, total: total}), do: {count, total}
end
