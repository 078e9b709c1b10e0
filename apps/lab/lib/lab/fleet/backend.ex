defmodule Lab.Fleet.Backend do
  @moduledoc """
  Decides where the robots and the world of a `Lab.Fleet` run: in this process of the operating system
  (`Lab.Fleet.Local`), or each in one of its own (`Lab.Fleet.Nodes`).

  All callbacks run in the fleet's process. A backend turns messages into events for the fleet's
  run log.
  """
  alias Sim.World
  alias Lab.Trial.Setup

  @type backend :: term()

  @typedoc "A robot died, and the fleet did not kill it; or something for the run log."
  @type event :: {:killed, atom()} | {:stage, atom(), atom() | nil, map()}

  @doc "Starts world and robots, all idle."
  @callback start(Setup.t(), keyword()) ::
              {:ok, backend()} | {:error, line :: String.t()}

  @doc "Starts the mission on all of them."
  @callback begin(backend()) :: :ok

  @doc "The robots that live, in the order of the fleet."
  @callback living(backend()) :: [atom()]

  @doc "What each of them claims about itself."
  @callback claims(backend()) :: [{atom(), map()}]

  @doc "Kills a living robot at once."
  @callback kill(backend(), atom()) :: backend()

  @doc "Carries out an event of a script (`Lab.Trial.Event`) that only its processes can, on a living robot."
  @callback suffer(backend(), Lab.Trial.Event.t()) :: backend()

  @doc "Cuts exactly these ways of the radio, or loses this share of all messages, from now on."
  @callback radio(backend(), {:cut_ways, [{atom(), atom()}]} | {:lose, number()}) :: backend()
  @optional_callbacks suffer: 2, radio: 2

  @doc "Changes the world."
  @callback change(backend(), World.Server.change()) :: backend()

  @doc "The current world."
  @callback world(backend()) :: World.t()

  @doc "The number of messages between robots so far."
  @callback messages(backend()) :: %{sent: non_neg_integer(), lost: non_neg_integer()}

  @doc "How to reach the processes of the operating system, one line each."
  @callback lines(backend()) :: [String.t()]

  @doc """
  Handles any message to the fleet that the fleet itself does not know. `:ended` says, in one line,
  why the run cannot go on; what is known of it can still be asked.
  """
  @callback hear(backend(), message :: term()) ::
              {:ok, [event()], backend()}
              | {:ended, line :: String.t(), backend()}
              | {:stop, reason :: term()}

  @doc "Ends world and robots."
  @callback stop(backend()) :: term()
end
