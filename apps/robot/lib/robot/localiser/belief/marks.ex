defmodule Robot.Localiser.Belief.Marks do
  @moduledoc false
  # Keeps the marks of a belief: objects at reported places, each with the offset from there as two states
  # of the filter. Adds a mark when it is first met, keeps up with what is reported of it, and drops
  # the one that was used least recently when there are too many. Pure.
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Covariance}

  # With this many marks, a new one replaces the one that was used least recently.
  @marks 6
  # A mark whose reported place moves by more than this (metres) counts as another object.
  @elsewhere 1.0
  # A mark starts anew if its reported standard deviation falls below this share of the former
  # one.
  @surer 0.75
  # The index of the common error among the states of a belief, and that of the first mark.
  @common 7
  @own @common + 1

  @doc """
  The estimated place of a mark that was reported at `at`, with the uncertainty `spread`, of which
  all robots share `common` (`Robot.Localiser.Anchors.common/3`): the reported place at first, and
  then that place corrected by its sightings. Adds the mark to the states if it is new.
  """
  @spec meet(Belief.t(), key :: term(), Pose.point(), Anchors.spread(), common :: Pose.point()) ::
          {Belief.t(), Pose.point()}
  def meet(belief, key, {x, y} = at, spread, common \\ {0.0, 0.0}) do
    {worst, least, _direction} = spread
    sd = :math.sqrt((worst * worst + least * least) / 2)

    case Enum.find_index(belief.marks, &(&1.key == key)) do
      nil ->
        {add(belief, key, at, spread, sd, common), at}

      index ->
        mark = Enum.at(belief.marks, index)
        moved = Pose.distance(mark.told, at)

        if moved > @elsewhere or sd < @surer * mark.sd do
          {belief |> drop(index) |> add(key, at, spread, sd, common), at}
        else
          {tell(belief, index, mark, at, sd, moved * moved), shift({x, y}, mark.off)}
        end
    end
  end

  # If the reported place moved or became less certain, the offset may be larger by that much.
  defp tell(belief, index, mark, at, sd, moved) do
    less_sure = sd * sd > 2 * mark.sd * mark.sd
    more = if less_sure, do: sd * sd - mark.sd * mark.sd, else: 0.0
    mark = %{mark | told: at, sd: if(less_sure, do: sd, else: mark.sd), used: belief.uses}

    %{
      belief
      | covariance:
          Covariance.add(belief.covariance, [moved + more, moved + more], @own + 2 * index),
        marks: List.replace_at(belief.marks, index, mark),
        uses: belief.uses + 1
    }
  end

  defp add(%{marks: marks} = belief, key, at, spread, sd, common)
       when length(marks) >= @marks do
    {_mark, index} = marks |> Enum.with_index() |> Enum.min_by(fn {mark, _} -> mark.used end)
    belief |> drop(index) |> add(key, at, spread, sd, common)
  end

  defp add(belief, key, at, spread, sd, {common_x, common_y}) do
    {xx, xy, yy} = Anchors.covariance(spread)
    mark = %{key: key, told: at, sd: sd, off: {0.0, 0.0}, used: belief.uses}

    %{
      belief
      | covariance:
          Covariance.append(belief.covariance, [[xx, xy], [xy, yy]], @common, [common_x, common_y]),
        marks: belief.marks ++ [mark],
        uses: belief.uses + 1
    }
  end

  defp drop(belief, index) do
    %{
      belief
      | covariance: Covariance.drop(belief.covariance, @own + 2 * index, 2),
        marks: List.delete_at(belief.marks, index)
    }
  end

  @doc "The belief without marks, and without correlation with their common error."
  @spec forget(Belief.t()) :: Belief.t()
  def forget(%Belief{marks: []} = belief),
    do: %{belief | covariance: Covariance.replace(belief.covariance, @common, 1.0)}

  def forget(belief), do: belief |> drop(length(belief.marks) - 1) |> forget()

  defp shift({x, y}, {dx, dy}), do: {x + dx, y + dy}
end
