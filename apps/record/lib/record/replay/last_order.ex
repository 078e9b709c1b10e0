defmodule Record.Replay.LastOrder do
  @moduledoc """
  Finds in the entries of a recorded robot the last order of a person that came to its pilot or its e-stop: what, by whom,
  when, and whether the robot obeyed it. Pure.
  """
  alias Robot.Control.Delivery

  @typedoc """
  `by` is the giver (`Swarm.by/2`), `nil` where the recording does not say it. `obeyed?` is `nil` while that is not known.
  """
  @type t :: %{
          role: :pilot | :estop,
          order: term(),
          by: String.t() | nil,
          at_ms: integer(),
          obeyed?: boolean() | nil
        }

  @doc """
  The last order after an entry of a role, by what the role's part of the replay was before the entry and is after it
  (`t:Record.Replay.part/0`).

      iex> alias Record.Replay.LastOrder
      iex> stop = {:input, {:cast, {:at, %{by: "gamepad"}, {:command, :stop, nil, nil}}}, 700}
      iex> order = LastOrder.note(nil, :estop, stop, %{state: nil}, %{state: nil})
      iex> order
      %{role: :estop, order: :stop, by: "gamepad", at_ms: 700, obeyed?: nil}
      iex> LastOrder.note(order, :estop, {:effect, {:cast, :gate, {:forget, :recorded}}, 700}, %{}, %{}).obeyed?
      true
  """
  @spec note(t() | nil, atom(), {atom(), term(), integer()}, map(), map()) :: t() | nil
  def note(last, role, {:input, input, at_ms}, before, after_it) do
    case order(role, input, before, after_it) do
      {order, by} -> %{role: role, order: order, by: by, at_ms: at_ms, obeyed?: nil}
      nil -> ended(last, role)
    end
  end

  def note(
        %{role: role, obeyed?: nil} = last,
        role,
        {:effect, effect, _at_ms},
        _before,
        _after_it
      ) do
    case effect do
      {:cast, :executive, {:confirm, _then, :ok}} -> %{last | obeyed?: true}
      {:cast, :gate, _stop} -> %{last | obeyed?: true}
      {:cast, :comms, {:rejected, _why}} -> %{last | obeyed?: false}
      _other -> last
    end
  end

  def note(last, _role, _entry, _before, _after_it), do: last

  # What is done on an order follows it before the role's next input; no word of it is a refusal.
  defp ended(%{role: role, obeyed?: nil} = last, role), do: %{last | obeyed?: false}
  defp ended(last, _role), do: last

  defp order(:pilot, {:cast, {:deliver, %Delivery{} = delivery, {:command, command}}}, _, _),
    do: {command, Map.get(delivery, :by)}

  defp order(:estop, {:cast, {:at, seen, {:command, request, _ref, _order}}}, _, _),
    do: {request, Map.get(seen, :by)}

  # A call that came by datagram says its node alone, and comes again and again.
  defp order(
         :estop,
         {:cast, {:at, _seen, {:estop, {node, _boot, _counter} = call, _age_ms}}},
         %{state: %{stop: before}},
         %{state: %{stop: stop}}
       )
       when before != stop,
       do: {{:estop, call}, Atom.to_string(node)}

  defp order(_role, _input, _before, _after_it), do: nil
end
