defmodule Hal.Event do
  @moduledoc """
  Reports events in telemetry's shape: what happened, numbers, and what it concerns. Libraries emit events instead of
  logging them, and listeners attach functions. If `:telemetry` is loaded, it receives every event too.

  An event that is emitted before the `:hal` application has started is lost.

  The events of a robot's devices have its `robot` in their metadata too.

  | event | measurements | metadata |
  |---|---|---|
  | `[:hal, :device, :online]` | `at_ms` | `device`, `driver`, `again?`: whether it was offline before |
  | `[:hal, :device, :offline]` | `at_ms` | `device`, `driver`, `reason`, `line`: the reason in words; once for each reason, not for each attempt |
  | `[:hal, :device, :watchdog]` | `at_ms` | `device`, `driver`: no speed came in time, and the wheels are stopped |
  | `[:hal, :rflex, :lost]` | `at_ms`, and counters (`Hal.RFlex.Driver.counts/1`) | `port`: more was lost or refused on this line; checked every 10 s |
  | `[:hal, :device, :arming]` | `at_ms` | `device`, `driver`, `state`, `why`, `was` (the state before), `line` (how the line was lost, in words, or `nil`): the drive's arming, or the reason for it, has changed (`Hal.Device.Arming`) |
  | `[:hal, :device, :refused]` | `at_ms`, `refused` (how many so far) | `device`, `driver`: a speed came for wheels that are not armed |
  | `[:hal, :device, :refusal]` | `at_ms`, `count` (so far) | `device`, `driver`, `request`, `line`: the device itself refused what it was told, such as `:look`; the first in a row, and every 10 s (`Hal.Device.Obedience`) |
  | `[:hal, :device, :odd]` | `at_ms` | `device`, `driver`, `line`: something about the device is unusual, such as a camera that is taken for another model |
  | `[:hal, :event, :failure]` | | `handler`, `event`, `kind`, `reason`: a handler failed and was detached |
  | `[:vision, :view, :failed]` | `at_ms` | `view`, `reason`, `line`: the encoder of the pictures failed, and is restarted |
  | `[:vision, :view, :healed]` | `at_ms` | `view`: the encoder makes pictures again |
  | `[:vision, :saver, :failed]` | `at_ms` | `folder`, `reason`, `line`: no picture can be saved; tried again |
  | `[:vision, :saver, :healed]` | `at_ms` | `folder`: pictures are saved again |
  | `[:robot, :dry_run]` | `at_ms` | `robot`, `command`, `line`: what would be done if this were not a dry run |
  | `[:robot, :gate, :start]` | `at_ms` | `robot`, `latched?` |
  | `[:robot, :gate, :limits]` | `at_ms` | `robot`, `limits`: the reasons to limit the speed have changed |
  | `[:robot, :gate, :estop]`, `[:robot, :gate, :reset]` | `at_ms` | `robot` |
  | `[:robot, :estop_file, :error]` | | `robot`, `file`, `reason`: the latch is set as ordered, but would not survive a restart of the board; it is tried again |
  | `[:robot, :estop_file, :healed]` | | `robot`, `file`: it does now |
  | `[:robot, :departure_file, :failed]` | | `robot`, `file`: it cannot be noted that the robot has left its start pose; it is tried again each second |
  | `[:robot, :recorder, :failed]` | `at_ms` | `robots`, `robot` (the first of them), `line`: nothing can be recorded; a folder is tried again |
  | `[:robot, :recorder, :healed]` | `at_ms` | `robots`, `robot`, `file`: it is recorded again |
  | `[:robot, :incident, :kept]`, `[:robot, :incident, :failed]` | `at_ms` | `robots`, `robot` (the first of them), `why` (lines), `file` or `line`: their last minute is written, or could not be |
  | `[:robot, :executive, :away]` | `at_ms` | `robot`: it was started again away from its start pose, and does not know where it is |
  | `[:robot, :executive, :start]` | `at_ms` | `robot`: the robot is idle |
  | `[:robot, :executive, :slow]` | `at_ms`, `duration_ms` | `robot`: a tick took over 50 ms |
  | `[:robot, :fault]` | `at_ms` | `robot`, `line`: why it stands without having been stopped, such as a bumper that stays pressed; `nil` when that is over |
  | `[:robot, :executive, :silent]` | `at_ms` | `robot`, `behaviour` (a module, or `nil`), `line` (where, in words): it misses its ticks |
  | `[:robot, :executive, :hung]` | `at_ms` | the same: it has missed them for 2 s, and is restarted |
  | `[:robot, :executive, :again]` | `at_ms` | the same: it ticks again without a restart |
  | `[:robot, :pilot, :silent]`, `[:robot, :pilot, :hung]`, `[:robot, :pilot, :again]` | `at_ms` | `robot`, `mission`, `line`: the same for a mission that does not return |
  | `[:robot, :gate, :silent]`, `[:robot, :gate, :hung]`, `[:robot, :gate, :again]` | `at_ms` | `robot`, `line`: the same for a gate that does not step |
  | `[:robot, :pilot, :phase]` | `at_ms` | `robot`, `state`: `:idle` or `{mission, phase}` |
  | `[:robot, :role, :dropped]` | `at_ms`, `count` (so far) | `robot`, `role`: its process was sent what the role does not know; at most once a minute for each process |
  | `[:robot, :stage]` | `at_ms` | `robot`, `stage`, and fields that the mission adds; `:refused`: `from`, `epoch`, `allowed`: that robot claims an epoch that no fleet can have reached, and is left out; `:given_up`: `x`, `y`, `blocked_by`: the robot gives up its way to that place; `:crashed`: `crash`, what failed in its mission or in a behaviour, and where: the robot is idle; `:disarmed`: its wheels were disarmed, which has ended its mission; `:replacement`: `what` (`:changing`, `:replaced`, `:kept`, `:back`), `from` (the node that ordered it), `says`: another mission was put in the place of the robot's own (`Swarm.replace/2`) |
  | `[:mesh, :refused]` | `at_ms` | `refused` (`:them`, `:us`), `who`, `address`, `why` (text or `nil`): this node refused another one, or was refused by it |
  | `[:swarm, :part, :fell]` | `at_ms` | `id`, `reason`: a part of the node crashed; it is restarted |
  | `[:swarm, :comms, :duplicate_id]` | | `robot`, `other`: another robot of this name was there first; this one stays silent |
  | `[:swarm, :comms, :unique_id]` | | `robot`: the other one has not been heard for 10 s; this one speaks again |
  | `[:swarm, :comms, :ordered]` | | `robot`, `order` (in words), `by` (its giver): a person's order that the robot obeys; of words of driving the first |
  | `[:swarm, :comms, :joystick]` | | `robot`, `line`: why it does not drive by its own joystick |
  | `[:mesh, :up]`, `[:mesh, :suspect]`, `[:mesh, :gone]` | `at_ms` | `node`, judged by its datagrams |
  | `[:mesh, :connected]`, `[:mesh, :disconnected]` | `at_ms` | `node`, by Erlang's distribution |
  | `[:mesh, :unknown_node]` | `at_ms` | `name`, `address`: a node has the secret, but is not in the roster |
  | `[:mesh, :duplicate_node]` | `at_ms` | `node`, `address`: another node uses this node's name, from that address; told once for each address, and every five minutes |
  | `[:mesh, :unique_node]` | `at_ms` | `node`: the other one has not been heard for 10 s |
  | `[:mesh, :no_network]` | `at_ms` | `line`: no node was heard for 3 s, and this is why (`Mesh.fault/0`); once for each reason |
  | `[:mesh, :network]` | `at_ms` | that is over |
  | `[:mesh, :libcluster]` | `at_ms` | `reason`: libcluster ended, and is restarted |
  | `[:swarm, :responder, :failure]` | | `robot`, `service`, `kind`, `reason`: the code of a service failed |
  | `[:swarm, :blackboard, :rival]` | | `robot`, `incarnation`, `node`: rows of another robot of this name came from that node |
  | `[:sim, :emulator, :line]` | `at_ms` | `link`, `reason`: an emulated device could not open its serial line; tried again |
  | `[:sim, :server, :late]` | `late_ms` | `world`: a step of the simulated world came late |
  """
  require Logger

  @table __MODULE__

  @type name :: [atom(), ...]
  @type handler :: (name(), measurements :: map(), metadata :: map(), config :: term() -> term())

  @doc """
  Calls all handlers of this event, in the calling process.

      iex> Hal.Event.execute([:nobody, :listens], %{at_ms: 5}, %{robot: :mag1})
      :ok
  """
  @spec execute(name(), map(), map()) :: :ok
  def execute(event, measurements, metadata \\ %{})
      when is_list(event) and is_map(measurements) and is_map(metadata) do
    for {_key, id, function, config} <- handlers(event) do
      run(id, function, event, measurements, metadata, config)
    end

    # Telemetry is not a dependency, but a project that has it receives our events there.
    if :erlang.function_exported(:telemetry, :execute, 3),
      do: apply(:telemetry, :execute, [event, measurements, metadata])

    :ok
  end

  @doc """
  Attaches a handler: at each such event `function.(event, measurements, metadata, config)` is
  called. A function that raises, throws or exits is detached.

      iex> Hal.Event.attach(:doc, [:doc, :event], fn _, %{n: n}, _, to -> send(to, n) end, self())
      :ok
      iex> Hal.Event.attach(:doc, [:doc, :event], fn _, _, _, _ -> :ok end, nil)
      {:error, :already_exists}
      iex> Hal.Event.execute([:doc, :event], %{n: 7})
      iex> receive do n -> n end
      7
      iex> Hal.Event.detach(:doc)
      :ok
  """
  @spec attach(id :: term(), name(), handler(), config :: term()) ::
          :ok | {:error, :already_exists}
  def attach(id, [first | _] = event, function, config)
      when is_atom(first) and is_function(function, 4) do
    if :ets.insert_new(@table, {{:id, id}, event}) do
      :ets.insert(@table, {{:event, event}, id, function, config})
      :ok
    else
      {:error, :already_exists}
    end
  end

  @doc """
  Detaches a handler.

      iex> Hal.Event.detach(:never_attached)
      {:error, :not_found}
  """
  @spec detach(id :: term()) :: :ok | {:error, :not_found}
  def detach(id) do
    # When a node shuts down, the table may be gone before its listeners.
    case :ets.whereis(@table) != :undefined and :ets.take(@table, {:id, id}) do
      [{_key, event}] ->
        :ets.match_delete(@table, {{:event, event}, id, :_, :_})
        :ok

      _none ->
        {:error, :not_found}
    end
  end

  @doc false
  def create_table do
    # A bag, so that one lookup finds all handlers of an event; `insert_new` keeps ids unique.
    :ets.new(@table, [:bag, :public, :named_table, read_concurrency: true])
  end

  defp handlers(event) do
    case :ets.whereis(@table) do
      :undefined -> []
      table -> :ets.lookup(table, {:event, event})
    end
  end

  # The handler is foreign code that runs in, for example, the gate: its failure must not stop a
  # robot. That is why everything is caught here.
  defp run(id, function, event, measurements, metadata, config) do
    function.(event, measurements, metadata, config)
  catch
    kind, reason ->
      detach(id)
      Logger.error("event handler #{inspect(id)} detached: #{inspect({kind, reason})}")

      if event != [:hal, :event, :failure] do
        failure = %{handler: id, event: event, kind: kind, reason: reason}
        execute([:hal, :event, :failure], %{}, failure)
      end
  end
end
