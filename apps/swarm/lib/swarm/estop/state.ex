defmodule Swarm.EStop.State do
  @moduledoc """
  Models the spreading and clearing of an emergency stop, as a function. Pure.

  Each stop has a tag, made from its call (`tag/1`). A robot is held by a set of stops. Every heartbeat carries the tags
  of those that hold its robot, and a robot that hears a tag that no person has cleared here is held by that stop, too. A
  reset clears all that hold the robot. So a stop reaches every robot that is connected with one that it holds, also one that
  was cut off or has started again before; and a robot that a person has reset is not stopped again by a neighbour that
  no person has reset yet.

  Whatever one hears, nothing grows: at most 16 stops hold a robot at a time, and the last 256 that were cleared are
  remembered. No stop is refused: a robot that is held by so many is held.

  `calls` remembers which calls to stop were heard (`Swarm.EStop.Calls`), so that a late repeat does not latch again
  what a person has reset.
  """
  alias Swarm.EStop.Calls
  alias Swarm.Wire.StopTags

  @most_cleared 256

  defstruct held: [], cleared: [], calls: []

  @type tag :: StopTags.tag()

  @type t :: %__MODULE__{held: [tag()], cleared: [tag()], calls: Calls.t()}

  @doc """
  The names of the nodes whose calls hold the robot, as far as their calls were heard here, without their hosts; in a
  simulation they may be robots.

      iex> stop = Swarm.EStop.State.press(Swarm.EStop.State.new(), {:base@hall, 1_700_000_000_000, 1})
      iex> {Swarm.EStop.State.callers(stop), Swarm.EStop.State.callers(Swarm.EStop.State.reset(stop))}
      {["base"], []}
  """
  @spec callers(t()) :: [String.t()]
  def callers(%__MODULE__{held: []}), do: []

  def callers(%__MODULE__{held: held, calls: calls}) do
    names =
      for {node, {boot, counter}} <- calls, tag({node, boot, counter}) in held do
        [name | _host] = node |> Atom.to_string() |> String.split("@")
        if name == "nonode", do: "this program", else: name
      end

    names |> Enum.uniq() |> Enum.sort()
  end

  @doc "The state without a stop."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "Whether a stop holds the robot."
  @spec held?(t()) :: boolean()
  def held?(%__MODULE__{held: held}), do: held != []

  @doc """
  The tag of the stop that a call makes.

      iex> tags = for counter <- 1..2, do: Swarm.EStop.State.tag({:base@hall, 1_700_000_000_000, counter})
      iex> {Enum.uniq(tags) == tags, Swarm.Wire.StopTags.tags?(tags)}
      {true, true}
  """
  @spec tag(Calls.call()) :: tag()
  def tag(call), do: :erlang.phash2(call, StopTags.count())

  @doc """
  A person stops the fleet here; the call, which is sent to the others, is remembered.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> Swarm.EStop.State.press(Swarm.EStop.State.new(), call).held == [Swarm.EStop.State.tag(call)]
      true
  """
  @spec press(t(), Calls.call()) :: t()
  def press(%__MODULE__{} = stop, call) do
    tag = tag(call)
    {held, over} = Enum.split([tag | List.delete(stop.held, tag)], StopTags.most())
    # What others still say of those that are too many is not another stop.
    clear(%{late(stop, call) | held: held}, over)
  end

  @doc """
  Hears a call to stop; one that was heard before changes nothing.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.call(Swarm.EStop.State.new(), call)
      iex> Swarm.EStop.State.held?(stop)
      true
      iex> stop |> Swarm.EStop.State.reset() |> Swarm.EStop.State.call(call) |> Swarm.EStop.State.held?()
      false
  """
  @spec call(t(), Calls.call()) :: t()
  def call(%__MODULE__{} = stop, call) do
    case Calls.hear(stop.calls, call) do
      {false, _calls} -> stop
      {true, calls} -> hear(%{stop | calls: calls}, [tag(call)])
    end
  end

  @doc """
  Remembers a call that was made before a person reset this robot, but is heard for the first time
  only now: it no longer stops anything. Robots that it still holds do, by their heartbeats.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.late(Swarm.EStop.State.new(), call)
      iex> Swarm.EStop.State.call(stop, call) |> Swarm.EStop.State.held?()
      false
  """
  @spec late(t(), Calls.call()) :: t()
  def late(%__MODULE__{} = stop, call), do: %{stop | calls: elem(Calls.hear(stop.calls, call), 1)}

  @doc """
  Hears a neighbour's heartbeat: the tags of the stops that hold it.

      iex> stop = Swarm.EStop.State.hear(Swarm.EStop.State.new(), [7, 8])
      iex> stop.held
      [7, 8]
      iex> Swarm.EStop.State.hear(Swarm.EStop.State.reset(stop), [8, 7]).held
      []
      iex> Swarm.EStop.State.hear(Swarm.EStop.State.reset(stop), [8, 9]).held
      [9]
  """
  @spec hear(t(), [tag()]) :: t()
  def hear(%__MODULE__{} = stop, tags) do
    # Those that hold it stay, so that robots which hear each other agree at last, whatever they hear.
    case (Enum.uniq(tags) -- stop.cleared) -- stop.held do
      [] -> stop
      new -> %{stop | held: Enum.take(stop.held ++ new, StopTags.most())}
    end
  end

  @doc "A person clears what holds this robot."
  @spec reset(t()) :: t()
  def reset(%__MODULE__{held: held} = stop), do: clear(%{stop | held: []}, held)

  defp clear(stop, []), do: stop

  defp clear(%{cleared: cleared} = stop, tags),
    do: %{stop | cleared: Enum.take(tags ++ (cleared -- tags), @most_cleared)}
end
