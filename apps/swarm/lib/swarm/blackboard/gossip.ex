defmodule Swarm.Blackboard.Gossip do
  @moduledoc false
  # How blackboard and hints reach other nodes: by a transport, `{m, f, a}`, that may be a test's.
  alias Swarm.Mesh

  @repair_ms 1_000

  @type call :: {module(), atom(), list()}

  @doc "The options that both have, with their defaults."
  @spec options(name :: atom()) :: [atom() | {atom(), term()}]
  def options(name) do
    [
      :seed,
      name: name,
      transport: {Mesh, :cast, []},
      nodes: {__MODULE__, :alive, []},
      repair_ms: @repair_ms
    ]
  end

  @doc "Sends `:repair` to the calling process in about so many ms; never for `:never`."
  @spec repair_later(pos_integer() | :never, :rand.state()) :: :rand.state()
  def repair_later(:never, rand), do: rand

  # Not all nodes at one moment.
  def repair_later(ms, rand) do
    {part, rand} = :rand.uniform_s(rand)
    Process.send_after(self(), :repair, round(ms * (0.75 + 0.5 * part)))
    rand
  end

  @doc "To all other nodes. What does not go out, or gets lost, is repaired later."
  @spec cast(call(), atom(), term()) :: :ok
  def cast({m, f, a}, service, term), do: go(m, f, a ++ [service, term])

  @doc "To one of them."
  @spec cast(call(), atom(), node(), term()) :: :ok
  def cast({m, f, a}, service, node, term), do: go(m, f, a ++ [service, node, term])

  defp go(m, f, arguments) do
    _ok_or_too_big = apply(m, f, arguments)
    :ok
  end

  @doc "The nodes that the mesh hears now."
  @spec alive() :: [node()]
  def alive, do: for({node, %{status: :alive}} <- Mesh.view().nodes, do: node)

  @doc "Some of the nodes, chosen at random."
  @spec some(call(), pos_integer(), :rand.state()) :: {[node()], :rand.state()}
  def some({m, f, a}, count, rand) do
    {drawn, rand} =
      Enum.map_reduce(apply(m, f, a), rand, fn node, rand ->
        {number, rand} = :rand.uniform_s(rand)
        {{number, node}, rand}
      end)

    {drawn |> Enum.sort() |> Enum.take(count) |> Enum.map(&elem(&1, 1)), rand}
  end

  @doc "The state of a choice: from a seed, or a new one."
  @spec seed(nil | integer()) :: :rand.state()
  def seed(nil), do: :rand.seed_s(:exsss)
  def seed(seed), do: :rand.seed_s(:exsss, seed)
end
