defmodule Hal.Visca.Queue.Sockets do
  @moduledoc """
  Tracks which commands occupy a camera's two sockets, as far as it has reported. Pure.

  Answers get lost on a line, so the books may be wrong both ways. `:unknown` stands for something
  that works and is not known: it is the first to be cancelled when its socket is needed.
  """
  alias Hal.Visca.{Command, CommandClass}

  # The longest move at full speed takes 2.5 s, zoom about as much; switching on takes longer.
  @work_ms 10_000

  @typedoc "By socket: what works there, and since when."
  @type t :: %{optional(1..2) => {Command.t() | :unknown, since_ms :: integer()}}

  @doc "Both free."
  @spec new() :: t()
  def new, do: %{}

  @doc "Something begins to work in a socket; whatever was there before is over."
  @spec occupy(t(), 1..2, Command.t() | :unknown, integer()) :: t()
  def occupy(sockets, socket, command, now_ms) when socket in 1..2,
    do: Map.put(sockets, socket, {command, now_ms})

  @doc "A socket is free: what worked in it, `nil` if that is not known."
  @spec vacate(t(), 0..2) :: {Command.t() | nil, t()}
  def vacate(sockets, socket) do
    case Map.pop(sockets, socket) do
      {{command, _since_ms}, sockets} when command != :unknown -> {command, sockets}
      {_nothing, sockets} -> {nil, sockets}
    end
  end

  @doc "The camera says that both work: what is not in the books is unknown."
  @spec full(t(), integer()) :: t()
  def full(sockets, now_ms),
    do: Map.merge(%{1 => {:unknown, now_ms}, 2 => {:unknown, now_ms}}, sockets)

  @doc "Whether one is free."
  @spec free?(t()) :: boolean()
  def free?(sockets), do: map_size(sockets) < 2

  @doc """
  The socket that has to be cancelled before a command can go out, if there is one: with both
  busy the oldest whose work the command overrides, or a newer one has overridden; or else an unknown one. For a
  drive any move, since the D30 does not drive during one.

      iex> alias Hal.Visca.Queue.Sockets
      iex> sockets = Sockets.occupy(Sockets.new(), 1, {:look, 9, 0, 24, 20}, 0)
      iex> Sockets.in_the_way(sockets, {:look, 99, 0, 24, 20})
      nil
      iex> Sockets.in_the_way(sockets, {:drive, {:left, 6}, {:stop, 0}})
      1
      iex> sockets = Sockets.occupy(sockets, 2, {:look, 99, 0, 24, 20}, 100)
      iex> Sockets.in_the_way(sockets, {:zoom_to, 5})
      1
  """
  @spec in_the_way(t(), Command.t()) :: 1..2 | nil
  def in_the_way(sockets, {:drive, _, _} = command) do
    oldest(sockets, fn
      :unknown, _since_ms -> map_size(sockets) == 2
      # A drive is done at once, and is no move that refuses another.
      {:drive, _, _}, _since_ms -> map_size(sockets) == 2
      other, _since_ms -> CommandClass.overrides?(command, other)
    end)
  end

  def in_the_way(sockets, _command) when map_size(sockets) < 2, do: nil

  def in_the_way(sockets, command) do
    oldest(sockets, fn
      :unknown, _since_ms ->
        false

      old, since_ms ->
        CommandClass.overrides?(command, old) or overridden?(sockets, old, since_ms)
    end) || oldest(sockets, fn work, _since_ms -> work == :unknown end)
  end

  @doc "Frees what has worked for more than 10 s; gives those that are known."
  @spec expire(t(), integer()) :: {[Command.t()], t()}
  def expire(sockets, now_ms) do
    {late, rest} = Enum.split_with(sockets, fn {_, {_, since}} -> now_ms - since >= @work_ms end)
    {for({_socket, {command, _}} <- late, command != :unknown, do: command), Map.new(rest)}
  end

  @doc "When the next one expires."
  @spec wake_ms(t()) :: integer() | nil
  def wake_ms(sockets),
    do: sockets |> Enum.map(fn {_, {_, since}} -> since + @work_ms end) |> Enum.min(fn -> nil end)

  defp overridden?(sockets, old, since_ms) do
    Enum.any?(sockets, fn {_, {newer, newer_ms}} ->
      newer != :unknown and newer_ms > since_ms and CommandClass.overrides?(newer, old)
    end)
  end

  defp oldest(sockets, wanted?) do
    sockets
    |> Enum.filter(fn {_socket, {work, since_ms}} -> wanted?.(work, since_ms) end)
    |> Enum.min_by(fn {socket, {_work, since_ms}} -> {since_ms, socket} end, fn -> {nil, nil} end)
    |> elem(0)
  end
end
