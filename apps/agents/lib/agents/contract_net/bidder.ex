defmodule Agents.ContractNet.Bidder do
  @moduledoc """
  Bids for tasks, and carries out one at a time. Pure; time is passed in, in milliseconds.

      free --bids--> locked --accepted--> working --finished, cancelled--> free
        ^               |
        '-- rejected, --'
            or nothing heard in time

  A bid binds: until it is decided, or until 0.5 s after the bids were due, other managers are
  refused, so two of them cannot count on the same robot. A key identifies an announcement by
  conversation and round.
  """
  alias Agents.ContractNet.Cost

  @grace_ms 500
  # No announcement binds for longer than this, whatever it says.
  @longest_ms 10_000

  defstruct lock: nil, job: nil

  @type key :: term()
  @type t :: %__MODULE__{
          lock: %{key: key(), task: term(), cost: number(), until_ms: integer()} | nil,
          job: %{key: key(), task: term()} | nil
        }

  @doc "A task is announced, and bids are due after `left_ms`: returns what to answer."
  @spec announced(t(), key(), term(), Cost.t(), left_ms :: integer(), now_ms :: integer()) ::
          {t(), {:propose, number()} | {:refuse, :busy | :locked | :infeasible}}
  def announced(bidder, key, task, cost, left_ms, now_ms) do
    bidder = expire(bidder, now_ms)

    cond do
      not is_number(cost) ->
        {bidder, {:refuse, :infeasible}}

      bidder.job ->
        {bidder, {:refuse, :busy}}

      bidder.lock && bidder.lock.key == key ->
        {bidder, {:propose, bidder.lock.cost}}

      bidder.lock ->
        {bidder, {:refuse, :locked}}

      true ->
        until_ms = now_ms + min(max(left_ms, 0), @longest_ms) + @grace_ms
        lock = %{key: key, task: task, cost: cost, until_ms: until_ms}
        {%{bidder | lock: lock}, {:propose, cost}}
    end
  end

  @doc """
  The bid was accepted: `{:start, task}`, or `:working` if it has already started. `:refuse` if
  that bid does not bind it any more.
  """
  @spec accepted(t(), key(), integer()) :: {t(), {:start, term()} | :working | :refuse}
  def accepted(%{job: %{key: key}} = bidder, key, _now_ms), do: {bidder, :working}

  def accepted(bidder, key, now_ms) do
    case expire(bidder, now_ms) do
      %{job: nil, lock: %{key: ^key, task: task}} = bidder ->
        {%{bidder | lock: nil, job: %{key: key, task: task}}, {:start, task}}

      bidder ->
        {bidder, :refuse}
    end
  end

  @doc "The bid was rejected."
  @spec rejected(t(), key()) :: t()
  def rejected(%{lock: %{key: key}} = bidder, key), do: %{bidder | lock: nil}
  def rejected(bidder, _key), do: bidder

  @doc "The manager cancels: returns whether work has to stop."
  @spec cancelled(t(), key()) :: {t(), :stop | :nothing}
  def cancelled(%{job: %{key: key}} = bidder, key), do: {%{bidder | job: nil}, :stop}
  def cancelled(bidder, key), do: {rejected(bidder, key), :nothing}

  @doc "The work has ended, successfully or not."
  @spec finished(t()) :: t()
  def finished(bidder), do: %{bidder | job: nil}

  defp expire(%{lock: %{until_ms: until_ms}} = bidder, now_ms) when now_ms > until_ms,
    do: %{bidder | lock: nil}

  defp expire(bidder, _now_ms), do: bidder
end
