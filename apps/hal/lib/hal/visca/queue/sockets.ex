defmodule Hal.Visca.Queue.Sockets do
  @moduledoc false
  # Tracks which commands occupy a camera's two sockets, as far as it has reported. Pure.
  #
  # Answers get lost on a line, so this record may be wrong either way. `:unknown` stands for a
  # command that runs but is not known: when its socket is needed, it is cancelled unless a known
  # command is pointless.
  alias Hal.Visca.{Command, CommandClass}

  # The longest move at full speed takes 2.5 s, zoom about as much; switching on takes longer.
  @work_ms 10_000

  @typedoc "By socket: the command that runs there, and since when."
  @type t :: %{optional(1..2) => {Command.t() | :unknown, since_ms :: integer()}}

  @doc "Both sockets are free."
  @spec new() :: t()
  def new, do: %{}

  @doc "A command starts in a socket; whatever ran there before is over."
  @spec occupy(t(), 1..2, Command.t() | :unknown, integer()) :: t()
  def occupy(sockets, socket, command, now_ms) when socket in 1..2,
    do: Map.put(sockets, socket, {command, now_ms})

  @doc "Frees a socket; returns the command that ran in it, or `nil` if that is not known."
  @spec vacate(t(), 0..2) :: {Command.t() | nil, t()}
  def vacate(sockets, socket) do
    case Map.pop(sockets, socket) do
      {{command, _since_ms}, sockets} when command != :unknown -> {command, sockets}
      {_nothing, sockets} -> {nil, sockets}
    end
  end

  @doc """
  The camera reports that both sockets are busy: a socket without a record holds an unknown
  command.
  """
  @spec full(t(), integer()) :: t()
  def full(sockets, now_ms),
    do: Map.merge(%{1 => {:unknown, now_ms}, 2 => {:unknown, now_ms}}, sockets)

  @doc "Whether a socket is free."
  @spec free?(t()) :: boolean()
  def free?(sockets), do: map_size(sockets) < 2

  @doc """
  The socket that must be cancelled before a command can be sent, if there is one. With both busy
  it is the oldest whose command is overridden by this one, or by a newer one in a socket;
  otherwise that of an unknown command. For a drive it is that of any move, because the D30 does
  not drive during one.

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
      # A drive is done at once, and is not a move that makes the camera refuse another.
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

  @doc "Frees the sockets that have been busy for 10 s; returns their commands, if known."
  @spec expire(t(), integer()) :: {[Command.t()], t()}
  def expire(sockets, now_ms) do
    {late, rest} = Enum.split_with(sockets, fn {_, {_, since}} -> now_ms - since >= @work_ms end)
    {for({_socket, {command, _}} <- late, command != :unknown, do: command), Map.new(rest)}
  end

  @doc "When the next socket expires."
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
