defmodule Hal.Visca.Queue do
  @moduledoc """
  Decides which command to send to one VISCA camera, and when: a state machine of its two sockets.
  Pure; time is passed in, as integer milliseconds.

  A camera accepts a command (ACK, with the socket that it took), carries it out, and reports when
  it is done; meanwhile it accepts one more, and answers inquiries. Its answers do not say what
  they are answers to, so there is at most **one message at a time** on the line without its first
  answer.

  | event | reaction |
  |---|---|
  | no answer for 120 ms | sends the command again, 5 times in all; a cancel, `:address_set` and `:if_clear` 2 times; an inquiry (its caller repeats it), a relative step and a toggle only once; not if a newer command overrides it |
  | nothing at all heard for 1 s, though something was sent | `:no_answer` |
  | both sockets are busy, and a command waits | cancels the older one if it has become pointless, or an unknown one, or waits |
  | a drive during another move | cancels the move first: the D30 refuses the drive otherwise |
  | `:full` | the command waits again, 50 ms at least (a relative step or a toggle fails: the answer may be to one before it); an unknown command in a socket is cancelled |
  | `:cancelled`, `:no_socket` | the socket is free |
  | no completion for 10 s | the socket counts as free: `:no_completion` |
  | other errors | `{:failed, command, reason}` |

  The number of waiting commands is bounded (`Hal.Visca.CommandClass`): a newer target replaces a
  waiting one.

  ## Effects

  | effect | meaning |
  |---|---|
  | `{:say, command}` | to be sent |
  | `{:accepted, command}`, `{:done, command}` | by the camera |
  | `{:failed, command, reason}` | see `t:failure/0` |
  | `{:result, inquiry, value, took_ms}` | as in `Hal.Visca.Reply.value/2`; how long the answer took (ms) |
  | `{:cameras, n}`, `:cleared` | answers to `:address_set` and the clears |
  | `:network_change` | a camera of the chain was switched on; its sockets are empty |
  | `:no_answer` | the camera is silent |
  """
  alias Hal.Visca.{Command, CommandClass, Reply}
  alias Hal.Visca.Queue.Sockets

  # About 16 ms, and the time of 32 bytes; a USB adapter may hold bytes back for 16 ms more.
  @answer_ms 120
  @silent_ms 1_000
  @full_ms 50
  @tries 5

  defstruct waiting: [], asked: nil, sockets: Sockets.new(), silent_ms: nil, full_ms: nil

  @typedoc """
  `waiting` holds the commands in the order of sending, `asked` the one that has no answer yet;
  `silent_ms` is since when the camera owes one, `full_ms` when it reported that it is full.
  """
  @type t :: %__MODULE__{
          waiting: [Command.t()],
          asked: {Command.t(), at_ms :: integer(), tries :: pos_integer()} | nil,
          sockets: Sockets.t(),
          silent_ms: integer() | nil,
          full_ms: integer() | nil
        }
  @type failure :: Reply.reason() | :no_answer | :no_completion | :malformed
  @type effect ::
          {:say | :accepted | :done, Command.t()}
          | {:failed, Command.t(), failure()}
          | {:result, Command.inquiry(), term(), took_ms :: non_neg_integer()}
          | {:cameras, 0..7}
          | :cleared
          | :network_change
          | :no_answer

  @doc "A queue with nothing sent and nothing to send."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc """
  Adds a command to send.

      iex> {effects, queue} = Hal.Visca.Queue.push(Hal.Visca.Queue.new(), :home, 0)
      iex> effects
      [{:say, :home}]
      iex> {[], queue} = Hal.Visca.Queue.push(queue, {:look, 9, 0, 24, 20}, 10)
      iex> {[], queue} = Hal.Visca.Queue.push(queue, {:look, 99, 0, 24, 20}, 20)
      iex> {effects, _queue} = Hal.Visca.Queue.heard(queue, {:ack, 1}, 30)
      iex> effects
      [{:accepted, :home}, {:say, {:look, 99, 0, 24, 20}}]
  """
  @spec push(t(), Command.t(), integer()) :: {[effect()], t()}
  def push(%__MODULE__{} = queue, command, now_ms),
    do: say([], %{queue | waiting: CommandClass.put(queue.waiting, command)}, now_ms)

  @doc "Takes a reply of the camera."
  @spec heard(t(), Reply.t(), integer()) :: {[effect()], t()}
  def heard(%__MODULE__{} = queue, reply, now_ms) do
    {effects, queue} = answer(reply, %{queue | silent_ms: nil}, now_ms)
    say(effects, queue, now_ms)
  end

  @doc "Takes the time; needed at `wake_ms/1`, allowed at any time."
  @spec tick(t(), integer()) :: {[effect()], t()}
  def tick(%__MODULE__{} = queue, now_ms) do
    {late, sockets} = Sockets.expire(queue.sockets, now_ms)
    effects = for command <- late, do: {:failed, command, :no_completion}
    {more, queue} = overdue(%{queue | sockets: sockets}, now_ms)
    {said, queue} = say(more, queue, now_ms)
    {effects ++ said ++ silence(queue, now_ms), queue}
  end

  @doc "When `tick/2` is needed; `nil`: not before something else happens."
  @spec wake_ms(t()) :: integer() | nil
  def wake_ms(%__MODULE__{} = queue) do
    [
      queue.asked && elem(queue.asked, 1) + @answer_ms,
      queue.silent_ms && queue.silent_ms + @silent_ms,
      queue.asked == nil && queue.full_ms && queue.full_ms + @full_ms,
      Sockets.wake_ms(queue.sockets)
    ]
    |> Enum.filter(& &1)
    |> Enum.min(fn -> nil end)
  end

  # Answers

  defp answer({:ack, socket}, %{asked: {command, _, _}} = queue, now_ms) do
    if Command.immediate?(command),
      do: {[], occupy(queue, socket, :unknown, now_ms)},
      else: {[{:accepted, command}], queue |> free() |> occupy(socket, command, now_ms)}
  end

  # A late one, to a command that was given up: whatever it was, that socket is busy.
  defp answer({:ack, socket}, queue, now_ms), do: {[], occupy(queue, socket, :unknown, now_ms)}

  defp answer({:done, socket}, queue, _now_ms) do
    {command, queue} = vacate(queue, socket)
    {if(command, do: [{:done, command}], else: []), queue}
  end

  defp answer({:result, <<>>}, %{asked: {:if_clear_one, _, _}} = queue, _now_ms),
    do: {[:cleared], %{free(queue) | sockets: Sockets.new()}}

  defp answer({:result, bytes}, %{asked: {{:ask, inquiry}, at_ms, _}} = queue, now_ms) do
    case Reply.value(inquiry, bytes) do
      {:ok, value} -> {[{:result, inquiry, value, now_ms - at_ms}], free(queue)}
      # The answer to an earlier inquiry, or a damaged one: the right one may still come.
      :error -> {[], queue}
    end
  end

  defp answer({:cameras, n}, %{asked: {:address_set, _, _}} = queue, _now_ms),
    do: {[{:cameras, n}], free(queue)}

  defp answer(:cleared, %{asked: {:if_clear, _, _}} = queue, _now_ms),
    do: {[:cleared], %{free(queue) | sockets: Sockets.new()}}

  defp answer(:network_change, queue, _now_ms) do
    {effects, queue} = again(%{queue | sockets: Sockets.new(), full_ms: nil}, :no_answer)
    {[:network_change | effects], queue}
  end

  defp answer({:error, socket, reason}, %{asked: {{:cancel, socket}, _, _}} = queue, _now_ms)
       when reason in [:cancelled, :no_socket] do
    {command, queue} = queue |> free() |> vacate(socket)
    {if(command, do: [{:failed, command, :cancelled}], else: []), queue}
  end

  # The camera itself gave the command up, for a newer one.
  defp answer({:error, socket, :cancelled}, queue, _now_ms) do
    {command, queue} = vacate(queue, socket)
    {if(command, do: [{:failed, command, :cancelled}], else: []), queue}
  end

  defp answer({:error, _socket, :full}, %{asked: {command, _, _}} = queue, now_ms) do
    if Command.immediate?(command) do
      {[{:failed, command, :full}], free(queue)}
    else
      {effects, queue} = again(queue, :full)
      {effects, %{queue | sockets: Sockets.full(queue.sockets, now_ms), full_ms: now_ms}}
    end
  end

  # A damaged command gives a syntax error too: it is sent again, as if it had not been heard.
  defp answer({:error, _socket, reason}, %{asked: {_, _, _}} = queue, _now_ms)
       when reason in [:syntax, :length],
       do: retry(queue, reason)

  defp answer({:error, _socket, reason}, %{asked: {command, _, _}} = queue, _now_ms),
    do: {[{:failed, command, reason}], free(queue)}

  defp answer({:error, socket, reason}, queue, _now_ms) do
    {command, queue} = vacate(queue, socket)
    {if(command, do: [{:failed, command, reason}], else: []), queue}
  end

  defp answer(_not_asked_for, queue, _now_ms), do: {[], queue}

  # Time-outs

  defp overdue(%{asked: {_, at_ms, _}} = queue, now_ms) when now_ms - at_ms >= @answer_ms,
    do: retry(queue, :no_answer)

  defp overdue(queue, _now_ms), do: {[], queue}

  defp retry(%{asked: {command, _at_ms, tries}} = queue, reason) do
    cond do
      Enum.any?(queue.waiting, &CommandClass.overrides?(&1, command)) ->
        {[], free(queue)}

      tries < tries(command) ->
        {[], %{queue | asked: {command, nil, tries}}}

      match?({:cancel, _}, command) ->
        # The camera does not answer this: then nothing runs in that socket.
        {_command, queue} = queue |> free() |> vacate(elem(command, 1))
        {[], queue}

      true ->
        {[{:failed, command, reason}], free(queue)}
    end
  end

  defp tries({:ask, _}), do: 1
  defp tries({:cancel, _}), do: 2
  # Some cameras that are alone on their cable do not answer these.
  defp tries(command) when command in [:address_set, :if_clear], do: 2
  defp tries(command), do: if(CommandClass.repeatable?(command), do: @tries, else: 1)

  defp silence(%{silent_ms: since}, now_ms) when since != nil and now_ms - since >= @silent_ms,
    do: [:no_answer]

  defp silence(_queue, _now_ms), do: []

  # The next command

  defp say(effects, %{asked: {command, nil, tries}} = queue, now_ms),
    do: {effects ++ [{:say, command}], asked(queue, command, tries + 1, now_ms)}

  defp say(effects, %{asked: nil} = queue, now_ms) do
    queue = rested(queue, now_ms)

    case Enum.find_value(queue.waiting, &sayable(&1, queue)) do
      nil ->
        {effects, queue}

      command ->
        queue = %{queue | waiting: List.delete(queue.waiting, command)}
        {effects ++ [{:say, command}], asked(queue, command, 1, now_ms)}
    end
  end

  defp say(effects, queue, _now_ms), do: {effects, queue}

  # The command itself, or the cancel that must come before it.
  defp sayable(command, queue) do
    cond do
      Command.immediate?(command) -> command
      victim = Sockets.in_the_way(queue.sockets, command) -> {:cancel, victim}
      queue.full_ms == nil and Sockets.free?(queue.sockets) -> command
      true -> nil
    end
  end

  defp rested(%{full_ms: at_ms} = queue, now_ms) when at_ms != nil and now_ms - at_ms >= @full_ms,
    do: %{queue | full_ms: nil}

  defp rested(queue, _now_ms), do: queue

  defp asked(queue, command, tries, now_ms),
    do: %{queue | asked: {command, now_ms, tries}, silent_ms: queue.silent_ms || now_ms}

  defp free(queue), do: %{queue | asked: nil}

  # Back to the front, unless a newer one waits. One that must not be sent twice fails.
  defp again(%{asked: nil} = queue, _reason), do: {[], queue}

  defp again(%{asked: {command, _, _}} = queue, reason) do
    cond do
      Enum.any?(queue.waiting, &CommandClass.overrides?(&1, command)) ->
        {[], free(queue)}

      CommandClass.repeatable?(command) ->
        {[], %{free(queue) | waiting: [command | queue.waiting]}}

      true ->
        {[{:failed, command, reason}], free(queue)}
    end
  end

  defp occupy(queue, socket, command, now_ms),
    do: %{queue | sockets: Sockets.occupy(queue.sockets, socket, command, now_ms)}

  defp vacate(queue, socket) do
    {command, sockets} = Sockets.vacate(queue.sockets, socket)
    {command, %{queue | sockets: sockets}}
  end
end
