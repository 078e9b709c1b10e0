defmodule Mesh.Strategy do
  @moduledoc """
  Describes how nodes find each other. A strategy names addresses to send a beacon to; a node that hears one
  answers, and from then on both know each other's address, for ever.

  A strategy is a pair of pure functions, asked five times a second; `Mesh.Strategy.Gossip` and
  `Mesh.Strategy.Static` come with the mesh and may run together; others are given as
  `strategies: [{Module, options}]`.

      defmodule Lab.Strategy do
        @behaviour Mesh.Strategy

        @impl Mesh.Strategy
        def init(addresses), do: {:ok, addresses}

        @impl Mesh.Strategy
        def targets(addresses, _known, _now_ms, _chance), do: {addresses, addresses}
      end
  """

  @type address :: {:inet.ip4_address(), :inet.port_number()}

  @doc "Checks the options once, at the start; the error is one line."
  @callback init(options :: term()) :: {:ok, state :: term()} | {:error, String.t()}

  @doc """
  The addresses to send a beacon to now. `known` are the addresses of the nodes that are heard,
  which need none; `chance` is a number from 0.0 to 1.0, new with each call.
  """
  @callback targets(state :: term(), known :: [address()], now_ms :: integer(), chance :: float()) ::
              {[address()], state :: term()}
end
