defmodule Bridge.Dialect do
  @moduledoc """
  Defines a protocol that programs speak on a WebSocket, as functions: what one of them says becomes effects, which
  `Bridge.Connection` carries out.
  """
  alias Bridge.{Broker, Frames, Hub}

  @type state :: term()

  @typedoc """
  What is to be done: `:say` a frame; `:ask` for a topic, each so many ms at most, its messages with a tag, and `:drop` it; carry out a line that a person may
  type (`:order`), whose answer comes with `call`; `:drive` a robot so fast ahead (m/s) and to the left (rad/s) for half a
  second; get the parameters (`:values`), which come with `ref`; say in one line what is `:wrong` with what was said.
  """
  @type effect ::
          {:say, {:text | :binary, iodata()}}
          | {:ask, Broker.key(), Broker.tag(), every_ms :: non_neg_integer()}
          | {:drop, Broker.key()}
          | {:order, line :: String.t(), call :: term()}
          | {:drive, atom(), ahead :: float(), left :: float()}
          | {:values, ref :: term()}

  @doc "The subprotocol to speak, of those that were offered (`nil`: none); the error is one line."
  @callback subprotocol(offered :: [String.t()]) :: {:ok, String.t() | nil} | {:error, String.t()}

  @doc "Whether pages that come from there may speak it, besides those of this server."
  @callback origin?(origin :: String.t()) :: boolean()

  @doc "A new client, with the channels that there are, and what it is told first."
  @callback new([Hub.channel()]) :: {state(), [effect()]}

  @doc "What the client has said; `robots` are those of the fleet now."
  @callback hear(Frames.message(), robots :: [atom()], state()) :: {state(), [effect()]}

  @doc "What came of an order."
  @callback answer(call :: term(), Console.Orders.answer(), state()) :: {state(), [effect()]}

  @doc "The parameters of the fleet."
  @callback values(ref :: term(), %{String.t() => term()}, state()) :: {state(), [effect()]}

  @doc "A drive was refused."
  @callback refused(line :: String.t(), state()) :: {state(), [effect()]}

  @doc "What the client is told of a message of the hub, in another process; it needs no state. `nil` for nothing."
  @callback message(Broker.tag(), message :: term()) :: {:text | :binary, iodata()} | nil

  @doc "New channels, for the state of those who hear."
  @callback channels([Hub.channel()], state()) :: state()
end
