defmodule Swarm.Replacement.Admission do
  @moduledoc false
  # Decides whether an order is carried out: by its signer and time; whether its robots allow it now; whether its code may
  # come (`Swarm.Replacement.Code`). All robots of the node that it is for take it, or none. An error is one line.
  alias Swarm.Replacement
  alias Robot.Names
  alias Swarm.Replacement.{Entries, Job, Order}

  @watch_s div(Job.watch_ms(), 1_000)

  @typedoc "An order that is being carried out."
  @type job :: %{
          required(:job) => Job.t(),
          required(:modules) => [{module(), binary()}],
          optional(atom()) => term()
        }

  @doc """
  The order in a request to this robot. Nothing of its content is looked at before the signature, which `sign`
  makes; `last_us` is the time of the last one that this robot took, `nil` for none.
  """
  @spec read(
          atom(),
          {content :: binary(), mac :: term()},
          Order.stamp(),
          last_us :: integer() | nil,
          sign :: (binary() -> {:ok, binary()} | {:error, String.t()})
        ) :: {:ok, Order.t()} | {:error, line :: String.t()}
  def read(robot, {content, mac}, {_life, at_us} = stamp, last_us, sign) do
    with :ok <- Entries.allowed(robot),
         :ok <- small(content),
         {:ok, right} <- sign.(Order.signed_bytes(robot, stamp, content)),
         {:signed, true} <- {:signed, Order.same?(right, mac)},
         {:new, true} <- {:new, last_us == nil or at_us > last_us},
         {:ok, order} <- Order.decode(content),
         true <- Atom.to_string(robot) in order.to do
      {:ok, order}
    else
      {:signed, false} -> {:error, "this order is not signed by its fleet's key"}
      {:new, false} -> {:error, "this order was given before; repeat it"}
      {:error, line} -> {:error, line}
      _no_order_for_it -> {:error, "this order is malformed"}
    end
  end

  defp small(content) do
    if byte_size(content) <= Order.most_bytes(),
      do: :ok,
      else: {:error, "this order is larger than #{div(Order.most_bytes(), 1024)} kB"}
  end

  @doc "Which robots of this node it is for, and what it brings, if all of that may be now."
  @spec admit(
          Order.t(),
          [job()],
          loaded :: Replacement.Code.store(),
          kept :: Replacement.Code.store()
        ) ::
          {:ok, [atom()], module(), [{module(), binary()}], Replacement.Code.earlier()}
          | {:error, line :: String.t()}
  def admit(order, jobs, loaded, kept) do
    robots = Entries.meant(order)
    busy = Enum.filter(jobs, &busy?/1)

    with :ok <- each(robots, &free(&1, order, busy)),
         {:ok, module, modules, earlier} <- Replacement.Code.check(order, loaded, kept),
         :ok <- alone(Keyword.keys(modules), robots, busy),
         do: {:ok, robots, module, modules, earlier}
  end

  @doc "Whether it must not be disturbed. What has not been started yet gives way."
  @spec busy?(job()) :: boolean()
  def busy?(%{job: %{phase: phase}}), do: phase != :waiting

  @doc "Whether it concerns one of these robots or modules."
  @spec meets?(job(), [atom()], [module()]) :: boolean()
  def meets?(%{job: job, modules: modules}, robots, names) do
    Enum.any?(robots, &is_map_key(job.robots, &1)) or
      Enum.any?(names, &List.keymember?(modules, &1, 0))
  end

  defp each(robots, check) do
    Enum.find_value(robots, :ok, fn id ->
      with {:error, line} <- check.(id), do: {:error, "#{id}: #{line}"}
    end)
  end

  defp free(id, order, busy) do
    cond do
      Entries.held?(id) ->
        {:error, "it is held by the emergency stop; reset it first"}

      Enum.any?(busy, &meets?(&1, [id], [])) ->
        {:error, "what it was given last is watched for #{@watch_s} s first"}

      true ->
        Entries.allowed(id, order.code != [])
    end
  end

  # Code is the node's: a robot that runs it but is not meant would go on with a state that the new code does not know.
  defp alone(names, robots, busy) do
    others =
      for id <- Names.robots() -- robots, {module, _} <- [Entries.running(id)], do: {id, module}

    other = Enum.find(others, fn {_id, module} -> module in names end)

    cond do
      Enum.any?(busy, &meets?(&1, [], names)) ->
        {:error, "the same code was given to others, and is watched for #{@watch_s} s first"}

      other ->
        {id, module} = other

        {:error,
         "#{id} runs #{inspect(module)} on this node, too, and they share its code: give it to both"}

      true ->
        :ok
    end
  end
end
