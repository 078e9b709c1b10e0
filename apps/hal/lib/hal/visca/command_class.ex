defmodule Hal.Visca.CommandClass do
  @moduledoc false
  # Classes of commands to a camera that replace each other: at most one of each class waits. Pure.
  #
  # A newer target for the head makes an older one pointless; the same holds for zoom, power and
  # each inquiry. The number of waiting commands is therefore bounded by the number of classes,
  # however fast commands come and however slow the camera is. Relative steps have a class of their
  # own, in which they add up.
  alias Hal.Visca.Command

  @type t :: atom() | {atom(), term()}

  @doc """
  The class of a command.

      iex> Hal.Visca.CommandClass.of({:look, 1, 2, 24, 20}) == Hal.Visca.CommandClass.of(:home)
      true
  """
  @spec of(Command.t()) :: t()
  def of({:look, _, _, _, _}), do: :move
  def of({:step, _, _, _, _}), do: :step
  def of({:drive, _, _}), do: :move
  def of(command) when command in [:home, :reset], do: :move
  def of({:zoom, _}), do: :zoom
  def of({:zoom, _, _}), do: :zoom
  def of({:zoom_to, _}), do: :zoom
  def of({:memory, :recall, _}), do: :move
  def of({:memory, _, place}), do: {:memory, place}
  def of({:limit, corner, _, _}), do: {:limit, corner}
  def of({:limit_clear, corner}), do: {:limit, corner}
  def of({kind, what}) when kind in [:ask, :cancel], do: {kind, what}
  def of({kind, _}), do: kind
  def of(command) when is_atom(command), do: command

  @doc """
  Whether the first command, which is newer, makes the second one pointless.

      iex> Hal.Visca.CommandClass.overrides?(:home, {:step, 9, 0, 24, 20})
      true
      iex> Hal.Visca.CommandClass.overrides?({:step, 9, 0, 24, 20}, :home)
      false
  """
  @spec overrides?(Command.t(), Command.t()) :: boolean()
  def overrides?(newer, older) do
    case of(newer) do
      :step -> false
      :move -> of(older) in [:move, :step]
      lane -> of(older) == lane
    end
  end

  @doc """
  Adds a command to those that wait: in the place of the one that it overrides, or at the end.

      iex> Hal.Visca.CommandClass.put([{:zoom_to, 5}, {:ask, :position}], {:zoom_to, 9})
      [{:zoom_to, 9}, {:ask, :position}]
      iex> Hal.Visca.CommandClass.put([{:step, 5, 0, 24, 20}], {:step, 2, 1, 24, 20})
      [{:step, 7, 1, 24, 20}]
  """
  @spec put([Command.t()], Command.t()) :: [Command.t()]
  def put(waiting, {:step, pan, tilt, v, w} = command) do
    case Enum.find_index(waiting, &match?({:step, _, _, _, _}, &1)) do
      nil ->
        waiting ++ [command]

      at ->
        {:step, before, before_tilt, _, _} = Enum.at(waiting, at)
        sum = {:step, limit(before + pan, 4534), limit(before_tilt + tilt, 1600), v, w}
        List.replace_at(waiting, at, sum)
    end
  end

  def put(waiting, command) do
    case Enum.find_index(waiting, &overrides?(command, &1)) do
      nil ->
        waiting ++ [command]

      at ->
        {before, [_old | rest]} = Enum.split(waiting, at)
        before ++ [command | Enum.reject(rest, &overrides?(command, &1))]
    end
  end

  @doc """
  Whether a command may be sent again when it is not known whether the camera has received it.

      iex> Hal.Visca.CommandClass.repeatable?({:step, 9, 0, 24, 20})
      false
  """
  @spec repeatable?(Command.t()) :: boolean()
  def repeatable?({:step, _, _, _, _}), do: false
  def repeatable?({:screen, :toggle}), do: false
  def repeatable?(_command), do: true

  defp limit(n, most), do: n |> max(-most) |> min(most)
end
