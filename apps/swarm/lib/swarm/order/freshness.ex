defmodule Swarm.Order.Freshness do
  @moduledoc """
  Determines when an order was given, without a shared clock, and whether a robot should still
  obey it. Pure; times are `System.monotonic_time/1` of the robot's node, in microseconds.

  A sender on another node first asks the robot for a stamp, which holds the robot's time. The
  order then carries that time, minus how long the stamp took beyond 50 ms (`given/2`), so it was
  given at most 50 ms before that time. The robot refuses an order that is older than half a
  second, because its sender no longer waits for an answer; one with a stamp of another life of the
  process; and one that may have been given more than 50 ms before the robot was last stopped.

  An order needs two round trips within that half second: over a link whose round trip takes longer
  than some 220 ms robots can be stopped, and ordered nothing else.

      iex> alias Swarm.Order.Freshness
      iex> stamp = Freshness.stamp(7, 1_000_000)
      iex> {:ok, order} = Freshness.given(stamp, 80_000)
      iex> order
      {7, 970_000}
      iex> Freshness.check(7, order, 1_200_000, nil)
      {:ok, 970_000}
      iex> Freshness.check(7, order, 1_200_000, 980_000)
      {:error, :stopped}
      iex> Freshness.check(7, order, 2_970_000, nil)
      {:error, 2_000}
      iex> Freshness.check(8, order, 1_200_000, nil)
      {:error, :unknown}
  """

  # How long the sender of an order waits for an answer (`Swarm.Commands.Client`).
  @longest_us 500_000
  # Allowed for the way back of a stamp. A person who stops a robot and then starts it must not be
  # refused because that way was slow once; and no robot can tell the order of two actions of people
  # on two machines within this time.
  @way_back_us 50_000

  @typedoc "The number of a process's life, and a time."
  @type stamp :: {life :: integer(), at_us :: integer()}

  @typedoc """
  Why an order is not obeyed: its age, which may be unknown, or a stop after it was given.
  """
  @type refusal :: age_ms :: pos_integer() | :unknown | :stopped

  @doc "A stamp for a request now."
  @spec stamp(life :: integer(), now_us :: integer()) :: stamp()
  def stamp(life, now_us), do: {life, now_us}

  @doc """
  What an order carries if its stamp arrived so long after the order was given; `:error` if the
  stamp is invalid.
  """
  @spec given(term(), waited_us :: non_neg_integer()) :: {:ok, stamp()} | :error
  def given(stamp, waited_us) do
    with true <- stamp?(stamp),
         {life, at_us} = stamp,
         do: {:ok, {life, at_us - max(waited_us - @way_back_us, 0)}},
         else: (false -> :error)
  end

  @doc """
  Whether a request needs a stamp. A stop is obeyed at any age, and questions are harmless.

      iex> for request <- [:reset, :arm, :stop, :disarm], do: Swarm.Order.Freshness.needed?(request)
      [true, true, false, false]
  """
  @spec needed?(request :: term()) :: boolean()
  def needed?({:estop, _call}), do: false

  def needed?(request),
    do: request not in [:stop, :disarm, :estop, :status, :ping, :keep, :sonar, :layer]

  @doc "Whether a term from outside can be a stamp."
  @spec stamp?(term()) :: boolean()
  def stamp?({life, at_us}), do: is_integer(life) and is_integer(at_us)
  def stamp?(_other), do: false

  @doc """
  Whether a process of this life obeys a request now, and when the request was given; now, if it
  needs no stamp. `stopped_us` is when the robot was last stopped, `nil` if never. `here?` says
  whether the order was given on this node; then it carries `{:asked, at_us}`.

      iex> alias Swarm.Order.Freshness
      iex> Freshness.judge(7, :start, {:asked, 1_000_000}, true, 1_200_000, 900_000)
      {:ok, 1_000_000}
      iex> Freshness.judge(7, :start, {:asked, 1_000_000}, false, 1_200_000, 900_000)
      {:error, :unknown}
      iex> Freshness.judge(7, :stop, nil, false, 1_200_000, 900_000)
      {:ok, 1_200_000}
  """
  @spec judge(
          life :: integer(),
          request :: term(),
          order :: term(),
          here? :: boolean(),
          now_us :: integer(),
          stopped_us :: integer() | nil
        ) :: {:ok, given_us :: integer()} | {:error, refusal()}
  def judge(life, request, order, here?, now_us, stopped_us) do
    if needed?(request),
      do: judge(life, order, here?, now_us, stopped_us),
      else: {:ok, now_us}
  end

  defp judge(life, order, here?, now_us, stopped_us) do
    case order do
      {:asked, at_us} when here? -> check(life, {life, at_us}, now_us, stopped_us)
      order -> check(life, order, now_us, stopped_us)
    end
  end

  @doc """
  Whether a process of this life obeys an order with this stamp now, and when the order was given.
  """
  @spec check(integer(), term(), integer(), integer() | nil) ::
          {:ok, given_us :: integer()} | {:error, refusal()}
  def check(life, {life, given_us}, now_us, stopped_us)
      when is_integer(given_us) and given_us <= now_us do
    cond do
      now_us - given_us >= @longest_us -> {:error, div(now_us - given_us, 1_000)}
      stopped_us != nil and given_us < stopped_us -> {:error, :stopped}
      true -> {:ok, given_us}
    end
  end

  def check(_life, _order, _now_us, _stopped_us), do: {:error, :unknown}

  @doc """
  An order as it counts where it arrived: a time without a stamp only from this node (`here?`).

      iex> for here? <- [true, false], do: Swarm.Order.Freshness.arrived({:asked, 7}, here?)
      [{:asked, 7}, nil]
  """
  @spec arrived(order :: term(), here? :: boolean()) :: term()
  def arrived({:asked, _at_us}, false), do: nil
  def arrived(order, _here?), do: order

  @doc "The answer of a robot to an order that it does not obey."
  @spec refusal(robot :: atom(), refusal()) :: {:error, String.t()}
  def refusal(robot, :stopped),
    do: {:error, "#{robot} was stopped after this command was sent; repeat it"}

  def refusal(robot, :unknown),
    do: {:error, "#{robot} got this command too late to know how old it is; repeat it"}

  def refusal(robot, age_ms) do
    {:error,
     "#{robot} got this command too late, #{seconds(age_ms)} s old; at most 0.5 s are allowed; repeat it"}
  end

  @doc """
  The answer to an order that is too old to be sent.

      iex> Swarm.Order.Freshness.late(3_210)
      {:error, "given 3.2 s ago and not carried out: at most 0.5 s are allowed; repeat it"}
  """
  @spec late(age_ms :: non_neg_integer()) :: {:error, String.t()}
  def late(age_ms) do
    {:error,
     "given #{seconds(age_ms)} s ago and not carried out: at most 0.5 s are allowed; repeat it"}
  end

  defp seconds(age_ms), do: :erlang.float_to_binary(age_ms / 1000, decimals: 1)
end
