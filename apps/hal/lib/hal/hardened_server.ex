defmodule Hal.HardenedServer do
  @moduledoc """
  Runs the process of a `GenServer` module that must not end because of a message that it does not know.

  It calls the same callbacks as `GenServer`, and takes the same calls and casts. The difference is
  in what OTP's loop takes for granted, and what ends any `GenServer`, supervisor or `gen_statem`
  if it is not so:

    * a call counts only if its caller is `{pid, tag}`: the answer to any other cannot be sent;
    * a system message (`:sys`) counts only if it comes from a process of this node and is one that
      `:sys` sends. Everything else in its shape is dropped, also while the process is suspended.

  A module says `use Hal.HardenedServer` instead of `use GenServer`: what no clause of its callbacks
  takes goes to `drop/1`. What is dropped is counted, and the event `[:hal, :server, :dropped]` reports it, at most once a
  minute for each process.

  It does not protect against whoever sends exactly what a process expects: with the cookie of a
  fleet one may run any code (`docs/security.md`). An `{:EXIT, parent, reason}` that names the real
  parent, for example, ends the process, as the parent's own would.

  Differences for the module: there is no hibernation (`:hibernate` waits as usual), and no
  change of code while suspended.
  """
  alias Hal.HardenedServer.{Drops, Loop}

  @doc false
  defmacro __using__(options) do
    quote do
      @behaviour GenServer
      @before_compile Hal.HardenedServer

      @doc "The process as a child of a supervisor."
      @spec child_spec(term()) :: Supervisor.child_spec()
      def child_spec(arg) do
        Supervisor.child_spec(
          %{id: __MODULE__, start: {__MODULE__, :start_link, [arg]}},
          unquote(options)
        )
      end

      defoverridable child_spec: 1
    end
  end

  # Not by `use GenServer`: its own callbacks would come before these.
  @doc false
  defmacro __before_compile__(_env) do
    quote generated: true do
      def handle_call(_unknown, _from, state), do: Hal.HardenedServer.drop(state)
      def handle_cast(_unknown, state), do: Hal.HardenedServer.drop(state)
      def handle_info(_unknown, state), do: Hal.HardenedServer.drop(state)
    end
  end

  @doc """
  Whether a term is an `{m, f, a}` that can be applied with `more` further arguments: a function that
  its module exports, and a proper list. For callbacks that apply one.

      iex> alias Hal.HardenedServer
      iex> for call <- [{Kernel, :send, [self(), 1]}, {Kernel, :send, [self()]}, {Kernel, :send, [1 | 2]}, {:a, :b, []}],
      ...>     do: HardenedServer.callable?(call)
      [true, false, false, false]
      iex> {HardenedServer.callable?({Kernel, :send, [self()]}, 1), HardenedServer.callable?(nil)}
      {true, false}
  """
  @spec callable?(term(), more :: non_neg_integer()) :: boolean()
  def callable?(call, more \\ 0)

  # `length/1` fails for an improper list.
  def callable?({module, function, arguments}, more)
      when is_atom(module) and is_atom(function) and length(arguments) >= 0,
      do:
        Code.ensure_loaded?(module) and
          function_exported?(module, function, length(arguments) + more)

  def callable?(_other, _more), do: false

  @doc "Whether a term is `callable?/1`, or `nil` for nothing to apply."
  @spec then?(term()) :: boolean()
  def then?(then), do: then == nil or callable?(then)

  @doc """
  Starts the process of `module`, as `GenServer.start_link/3` does. Options: `:name`,
  `:spawn_opt`, `:timeout`.
  """
  @spec start_link(module(), arg :: term(), keyword()) :: GenServer.on_start()
  def start_link(module, arg, options \\ []) do
    {name, options} = Keyword.pop(options, :name)

    case name do
      nil ->
        :gen.start(Loop, :link, module, arg, options)

      name when is_atom(name) ->
        :gen.start(Loop, :link, {:local, name}, module, arg, options)

      {:via, _, _} ->
        :gen.start(Loop, :link, name, module, arg, options)
    end
  end

  @doc """
  The end of a callback for a message that the module does not know: it is counted, and nothing
  else happens.
  """
  @spec drop(state) :: {:noreply, state} when state: term()
  def drop(state) do
    Drops.add()
    {:noreply, state}
  end

  @doc "How many messages the calling process has dropped so far."
  @spec dropped() :: non_neg_integer()
  defdelegate dropped, to: Drops, as: :count
end
