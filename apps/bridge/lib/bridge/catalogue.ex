defmodule Bridge.Catalogue do
  @moduledoc "Defines what is said of a live fleet to the programs of one protocol: topics, and their messages as bytes. Pure."
  alias Bridge.Broker
  alias Lab.Recording.Drawing
  alias Sim.Scene

  @typedoc "A topic; `schema` is what describes it to the programs."
  @type topic :: %{
          key: Broker.key(),
          name: String.t(),
          schema: term(),
          pace: Broker.pace()
        }

  @doc "The topics of a fleet of these robots."
  @callback list([atom()]) :: [topic()]

  @doc "The robot that must be asked for what a topic says (`c:Console.Live.about/2`); `nil` if the scene says it."
  @callback asks(Broker.key()) :: atom() | nil

  @doc "What a scene says on a topic at a time in ns since 1970, with the robots' ways; `nil` if it says nothing."
  @callback scene(Broker.key(), ns :: non_neg_integer(), Scene.t(), Drawing.paths()) ::
              iodata() | nil

  @doc "What is known of a robot (`Console.About`), as one of its topics says it; `nil` if it says nothing."
  @callback about(Broker.key(), ns :: non_neg_integer(), map()) :: iodata() | nil

  @doc "The topics of the log."
  @callback log() :: [Broker.key()]

  @doc "What happened to a fleet, as a line of the log."
  @callback stage(Broker.key(), ns :: non_neg_integer(), Scene.stage()) :: iodata()

  @doc "What a person or a program ordered, and what came of it, as a line of the log."
  @callback order(
              Broker.key(),
              ns :: non_neg_integer(),
              asker :: String.t(),
              line :: String.t(),
              Console.Orders.answer()
            ) :: iodata()

  @doc "The scene with those robots alone that can be drawn on one floor: of a known pose, in the frame of most."
  @spec drawn(Scene.t()) :: Scene.t()
  def drawn(scene) do
    robots = for %{pose: %{}} = robot <- scene.robots, robot[:frame] in [nil, 0], do: robot
    %{scene | robots: robots}
  end
end
