defmodule Sim.Fleet.Backend do
  @moduledoc """
  Where the robots and the world of a `Sim.Fleet` run: in this process of the operating system
  (`Sim.Fleet.Local`), or each in one of its own (`Sim.Fleet.Nodes`).

  All is called in the fleet's process. What a backend makes of a message are events for the fleet's
  run_log.
  """
  alias Sim.World
  alias Sim.Trial.Setup

  @type backend :: term()

  @typedoc "A robot died, and nobody of us killed it; or something is to be written down."
  @type event :: {:killed, atom()} | {:stage, atom(), atom() | nil, map()}

  @doc "Starts world and robots, all idle."
  @callback start(Setup.t(), keyword()) ::
              {:ok, backend()} | {:error, line :: String.t()}

  @doc "Begins the mission on all of them."
  @callback begin(backend()) :: :ok

  @doc "The robots that live, in the order of the fleet."
  @callback living(backend()) :: [atom()]

  @doc "What each of them claims of itself."
  @callback claims(backend()) :: [{atom(), map()}]

  @doc "Kills a living robot at once."
  @callback kill(backend(), atom()) :: backend()

  @doc "Changes the world."
  @callback change(backend(), World.Server.change()) :: backend()

  @doc "The world as it is."
  @callback world(backend()) :: World.t()

  @doc "Its server; `nil` while there is none."
  @callback server(backend()) :: pid() | nil

  @doc "Messages between robots so far."
  @callback messages(backend()) :: %{sent: non_neg_integer(), lost: non_neg_integer()}

  @doc "How to reach the processes of the operating system, a line each."
  @callback lines(backend()) :: [String.t()]

  @doc "Any message to the fleet that it does not know itself."
  @callback hear(backend(), message :: term()) ::
              {:ok, [event()], backend()} | {:stop, reason :: term()}

  @doc "Ends all of it."
  @callback stop(backend()) :: term()
end
