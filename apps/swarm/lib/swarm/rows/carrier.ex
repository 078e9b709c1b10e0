defmodule Swarm.Rows.Carrier do
  @moduledoc false
  # How blackboard and hints reach other nodes: by a transport, `{m, f, a}`, that may be a test's. The
  # mesh hands on to them, and so it is not called by name from here (as in `Swarm.Post`).
  @mesh :"Elixir.Swarm.Mesh"

  @type call :: {module(), atom(), list()}

  @doc "To all other nodes. What does not go out, or gets lost, is repaired later."
  @spec cast(call(), atom(), term()) :: :ok
  def cast({m, f, a}, service, term), do: go(m, f, a ++ [service, term])

  @doc "To one of them."
  @spec cast(call(), atom(), node(), term()) :: :ok
  def cast({m, f, a}, service, node, term), do: go(m, f, a ++ [service, node, term])

  defp go(m, f, arguments) do
    if there?(m, f, length(arguments)), do: apply(m, f, arguments)
    :ok
  end

  @doc "The transport of the mesh."
  @spec mesh() :: call()
  def mesh, do: {@mesh, :cast, []}

  @doc "The nodes that the mesh hears now."
  @spec alive() :: [node()]
  def alive do
    if there?(@mesh, :view, 0) and apply(@mesh, :running?, []),
      do: for({node, %{status: :alive}} <- apply(@mesh, :view, []).nodes, do: node),
      else: []
  end

  defp there?(m, f, arity), do: Code.ensure_loaded?(m) and function_exported?(m, f, arity)

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
