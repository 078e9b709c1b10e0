defmodule Swarm.Replacement.Admission do
  @moduledoc false
  # Decides whether an order is carried out: by its signer and time; whether its robots allow it now; whether this build has
  # its mission. All robots of the node that it is for take it, or none. An error is one line.
  alias Hal.ExternalTerm
  alias Robot.Mission
  alias Swarm.Replacement.{Entries, Job, Order}

  @watch_s div(Job.watch_ms(), 1_000)

  @typedoc "An order that is being carried out."
  @type job :: %{required(:job) => Job.t(), optional(atom()) => term()}

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

  @doc "Which robots of this node it is for, and which mission it brings, if all of that may be now."
  @spec admit(Order.t(), [job()]) ::
          {:ok, [atom()], module()} | {:error, line :: String.t()}
  def admit(order, jobs) do
    robots = Entries.meant(order)
    busy = Enum.filter(jobs, &busy?/1)

    with :ok <- each(robots, &free(&1, busy)),
         {:ok, module} <- mission(order),
         do: {:ok, robots, module}
  end

  defp mission(%Order{mission: name}) do
    with {:ok, module} <- ExternalTerm.atom(name), true <- Mission.mission?(module) do
      {:ok, module}
    else
      _unknown -> {:error, "#{Order.name(name)} is not a mission of this build"}
    end
  end

  @doc "Whether it must not be disturbed. What has not been started yet gives way."
  @spec busy?(job()) :: boolean()
  def busy?(%{job: %{phase: phase}}), do: phase != :waiting

  @doc "Whether it concerns one of these robots."
  @spec meets?(job(), [atom()]) :: boolean()
  def meets?(%{job: job}, robots), do: Enum.any?(robots, &is_map_key(job.robots, &1))

  defp each(robots, check) do
    Enum.find_value(robots, :ok, fn id ->
      with {:error, line} <- check.(id), do: {:error, "#{id}: #{line}"}
    end)
  end

  defp free(id, busy) do
    cond do
      Entries.held?(id) ->
        {:error, "it is held by the emergency stop; reset it first"}

      Enum.any?(busy, &meets?(&1, [id])) ->
        {:error, "what it was given last is watched for #{@watch_s} s first"}

      true ->
        Entries.allowed(id)
    end
  end

  @doc "The options as this mission checks them, after it has made a state by them for each robot; the error is one line."
  @spec rehearse(module(), Order.t(), [atom()]) :: {:ok, keyword()} | {:error, line :: String.t()}
  def rehearse(module, order, robots) do
    with {:ok, options} <- options(order),
         {:ok, options} <- Mission.check_options(module, options, length(robots)) do
      for robot <- robots do
        {phase, _mission, effects} = module.init(robot, options)
        true = is_atom(phase) and is_list(effects)
      end

      {:ok, options}
    end
  end

  defp options(order) do
    with :error <- Order.options(order),
         do: {:error, "its options have names that this build does not know"}
  end
end
