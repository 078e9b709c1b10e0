defmodule Swarm.Commands.Freshness do
  @moduledoc """
  Determines the age of a command without a shared clock. Pure; times are the robot's own, in
  milliseconds.

  Whoever commands a robot of another node writes on it which heartbeat of that robot it heard last,
  `{boot, sequence}`, or asks the robot for such a stamp. The robot knows when it sent that
  heartbeat. So what was queued while a link was cut, or the robot was frozen, is told from what
  somebody wants now: it names a heartbeat that is older than 2 s, or one of another life.

      iex> sent = Swarm.Commands.Freshness.new(7) |> Swarm.Commands.Freshness.sent(1, 1_000)
      iex> Swarm.Commands.Freshness.check(sent, {7, 1}, 1_400)
      :ok
      iex> Swarm.Commands.Freshness.check(sent, {7, 1}, 21_000)
      {:error, 20_000}
      iex> Swarm.Commands.Freshness.check(sent, {6, 1}, 1_400)
      {:error, :unknown}
  """

  @keep 32
  @too_old_ms 2_000
  # Whoever asks on this node gives up then (`Swarm.Commands.Client`).
  @local_us 500_000
  # Who asks for stamps again and again shall not push heartbeats out of the memory.
  @anew_ms 200

  @enforce_keys [:boot]
  defstruct @enforce_keys ++ [beats: []]

  @type stamp :: {boot :: integer(), sequence :: non_neg_integer()}
  @type t :: %__MODULE__{
          boot: integer(),
          beats: [{sequence :: non_neg_integer(), at_ms :: integer()}]
        }

  @doc "Nothing sent yet in the life of this number."
  @spec new(integer()) :: t()
  def new(boot), do: %__MODULE__{boot: boot}

  @doc "A heartbeat goes out now. The last 32 are remembered."
  @spec sent(t(), non_neg_integer(), integer()) :: t()
  def sent(%__MODULE__{beats: beats} = sent, sequence, now_ms),
    do: %{sent | beats: Enum.take([{sequence, now_ms} | beats], @keep)}

  @doc "The number of the last heartbeat, 0 before the first."
  @spec last(t()) :: non_neg_integer()
  def last(%__MODULE__{beats: []}), do: 0
  def last(%__MODULE__{beats: [{sequence, _at_ms} | _]}), do: sequence

  @doc """
  A stamp for somebody who asks: the last heartbeat's, or, if that is some time ago, one with a
  number of its own, which no heartbeat will have.

      iex> {stamp, sent} = Swarm.Commands.Freshness.issue(Swarm.Commands.Freshness.new(7), 5_000)
      iex> {stamp, Swarm.Commands.Freshness.check(sent, stamp, 6_000), Swarm.Commands.Freshness.last(sent)}
      {{7, 1}, :ok, 1}
  """
  @spec issue(t(), integer()) :: {stamp(), t()}
  def issue(%__MODULE__{boot: boot, beats: [{sequence, at_ms} | _]} = sent, now_ms)
      when now_ms - at_ms < @anew_ms,
      do: {{boot, sequence}, sent}

  def issue(sent, now_ms) do
    sequence = last(sent) + 1
    {{sent.boot, sequence}, sent(sent, sequence, now_ms)}
  end

  @doc "Whether what bears this stamp is to be obeyed; if not, the stamp's age, where it is known."
  @spec check(t(), term(), integer()) :: :ok | {:error, age_ms :: integer() | :unknown}
  def check(%__MODULE__{boot: boot, beats: beats}, {boot, sequence}, now_ms) do
    case List.keyfind(beats, sequence, 0) do
      {_sequence, at_ms} when now_ms - at_ms <= @too_old_ms -> :ok
      {_sequence, at_ms} -> {:error, now_ms - at_ms}
      nil -> {:error, :unknown}
    end
  end

  def check(_sent, _stamp, _now_ms), do: {:error, :unknown}

  @doc """
  Whether a request needs a stamp. A stop is obeyed at any age, and questions do no harm.

      iex> for request <- [:reset, :arm, :stop, :disarm], do: Swarm.Commands.Freshness.needed?(request)
      [true, true, false, false]
  """
  @spec needed?(request :: term()) :: boolean()
  def needed?({:estop, _call}), do: false
  def needed?(request), do: request not in [:stop, :disarm, :estop, :status, :ping]

  @doc """
  Whether a robot is to obey a request now. One without a stamp is obeyed where whoever asked, by the
  reference that is to be answered, is on this node: it was not queued on the way.
  """
  @spec judge(t(), request :: term(), reference(), stamp :: term(), integer()) ::
          :ok | {:error, age_ms :: integer() | :unknown}
  def judge(sent, request, ref, stamp, now_ms) do
    if needed?(request) and (stamp != nil or node(ref) != node()),
      do: check(sent, stamp, now_ms),
      else: :ok
  end

  @doc """
  Whether what was asked on this node at `asked` may begin at `now`, the last stop being that of `stopped`: microseconds
  of `System.monotonic_time/1`. Whoever asked waits for half a second, and what was asked before a stop ended with it.

      iex> Swarm.Commands.Freshness.local(1_000_000, 1_200_000, 900_000)
      :ok
      iex> Swarm.Commands.Freshness.local(1_000_000, 1_200_000, 1_100_000)
      {:error, :stopped}
      iex> Swarm.Commands.Freshness.local(1_000_000, 1_700_000, nil)
      {:error, 700}
  """
  @spec local(asked :: integer(), now :: integer(), stopped :: integer() | nil) ::
          :ok | {:error, age_ms :: pos_integer() | :unknown | :stopped}
  def local(asked, now, _stopped) when asked > now, do: {:error, :unknown}
  def local(asked, _now, stopped) when stopped != nil and asked < stopped, do: {:error, :stopped}
  def local(asked, now, _stopped) when now - asked < @local_us, do: :ok
  def local(asked, now, _stopped), do: {:error, div(now - asked, 1_000)}

  @doc "What a robot answers to a command that it does not obey for its age."
  @spec refusal(robot :: atom(), age_ms :: integer() | :unknown | :stopped) ::
          {:error, String.t()}
  def refusal(robot, :stopped),
    do: {:error, "#{robot} was stopped after this was asked; say it again"}

  def refusal(robot, :unknown),
    do: {:error, "#{robot} got this too late to know how old it is; say it again"}

  def refusal(robot, age_ms) do
    seconds = :erlang.float_to_binary(age_ms / 1000, decimals: 1)

    {:error,
     "#{robot} got this too late, #{seconds} s old; at most 2 s are allowed, say it again"}
  end
end
