defmodule Sim.Fleet.Backend do
  @moduledoc """
  Where the robots and the world of a `Sim.Fleet` run: in this process of the operating system
  (`Sim.Fleet.Local`), or each in one of its own (`Sim.Fleet.Nodes`).

  All is called in the fleet's process. What a crew makes of a message are events for the fleet's
  ledger.
  """
  alias Sim.World
  alias Sim.Trial.Setup

  @type crew :: term()

  @typedoc "A robot died, and nobody of us killed it; or something is to be written down."
  @type event :: {:killed, atom()} | {:stage, atom(), atom() | nil, map()}

  @doc "Starts world and robots, all idle."
  @callback start(Setup.t(), keyword()) ::
              {:ok, crew()} | {:error, line :: String.t()}

  @doc "Begins the mission on all of them."
  @callback begin(crew()) :: :ok

  @doc "The robots that live, in the order of the fleet."
  @callback living(crew()) :: [atom()]

  @doc "What each of them claims of itself."
  @callback claims(crew()) :: [{atom(), map()}]

  @doc "Kills a living robot at once."
  @callback kill(crew(), atom()) :: crew()

  @doc "Changes the world."
  @callback change(crew(), World.Server.change()) :: crew()

  @doc "The world as it is."
  @callback world(crew()) :: World.t()

  @doc "Its server; `nil` while there is none."
  @callback server(crew()) :: pid() | nil

  @doc "Messages between robots so far."
  @callback messages(crew()) :: %{sent: non_neg_integer(), lost: non_neg_integer()}

  @doc "How to reach the processes of the operating system, a line each."
  @callback lines(crew()) :: [String.t()]

  @doc "Any message to the fleet that it does not know itself."
  @callback hear(crew(), message :: term()) ::
              {:ok, [event()], crew()} | {:stop, reason :: term()}

  @doc "Ends all of it."
  @callback stop(crew()) :: term()
end
