defmodule Robot.Control.Inbox do
  @moduledoc """
  Decides whether what arrives at the executive or the pilot is whole, so that one can calculate with it. Any process of a node
  may send them anything; what only looks like a message of theirs ends neither (`docs/security.md`). Pure.

  Numbers count up to 1.0e9 either way, which no robot measures: there are integers too large to be made a float.
  """
  alias Robot.Role
  alias Robot.Control.Delivery
  alias Robot.Localiser.Anchors

  @most 1.0e9

  defguardp is_measure(x) when is_number(x) and x > -@most and x < @most
  defguardp is_point(at) when is_measure(elem(at, 0)) and is_measure(elem(at, 1))

  defguardp is_triple(t)
            when tuple_size(t) == 3 and is_measure(elem(t, 0)) and is_measure(elem(t, 1)) and
                   is_measure(elem(t, 2))

  @doc """
  Whether a term is an order of a mission (`t:Robot.Mission.order/0`) whose goal a behaviour accepts.

      iex> alias Robot.Control.Inbox
      iex> for order <- [{:goal, 1, nil}, {:look, 0.5}, {:anchors, %Robot.Localiser.Anchors{}}], do: Inbox.order?(order)
      [true, true, true]
      iex> for order <- [{:goal, 1, {:nomodule, []}}, {:look, :left}, {:anchors, %Robot.Localiser.Anchors{marks: [1 | 2]}}],
      ...>     do: Inbox.order?(order)
      [false, false, false]
  """
  @spec order?(term()) :: boolean()
  def order?({:goal, _tag, goal}), do: Robot.Behaviour.check(goal) == :ok
  def order?({:look, pan}), do: pan == nil or is_measure(pan)

  def order?({:anchors, %{__struct__: Anchors, frame: frame, marks: marks} = anchors}),
    do: frame?(frame) and all?(marks, &mark?/1) and rest?(anchors)

  def order?(_other), do: false

  defp rest?(%{standing: standing, walls?: walls?}),
    do: (standing == nil or is_binary(standing)) and is_boolean(walls?)

  defp rest?(_anchors), do: false

  defp frame?(nil), do: true

  defp frame?(%{
         key: _,
         base: _,
         at: at,
         position: position,
         heading: heading,
         start: start,
         drift: drift,
         slip: slip
       })
       when is_point(at) and tuple_size(at) == 2 and is_measure(position) and
              is_measure(heading) and is_point(start) and is_triple(drift) and is_measure(slip),
       do: true

  defp frame?(_other), do: false

  defp mark?(%{
         key: _,
         kind: kind,
         colour: colour,
         at: at,
         sd: sd,
         common: common,
         reference?: reference?,
         radius: radius
       })
       when kind in [:landmark, :robot] and is_binary(colour) and is_point(at) and
              tuple_size(at) == 2 and is_triple(sd) and is_point(common) and
              is_boolean(reference?) and is_measure(radius),
       do: true

  defp mark?(_other), do: false

  @doc "Whether a term is a delivery (`t:Robot.Control.Delivery.t/0`) whose reply can be applied."
  @spec delivery?(term()) :: boolean()
  def delivery?(%{
        __struct__: Delivery,
        ways: ways,
        until_ms: until_ms,
        reply: reply,
        asked: asked
      })
      # `:infinity` in lockstep.
      when is_integer(until_ms) or until_ms == :infinity,
      do: integer_or_nil?(asked) and all?(ways, &way?/1) and Role.then?(reply, 1)

  def delivery?(_other), do: false

  defp way?({:hand, {kind, name}}),
    do: kind in [:only, :except, :taking, :naming] and is_atom(name)

  defp way?({:start, module, _options}), do: is_atom(module)
  defp way?(way), do: way == :resume

  defp integer_or_nil?(number), do: number == nil or is_integer(number)

  # Not `Enum.all?/2`, which raises for an improper list.
  defp all?([first | rest], fits?), do: fits?.(first) and all?(rest, fits?)
  defp all?(rest, _fits?), do: rest == []
end
