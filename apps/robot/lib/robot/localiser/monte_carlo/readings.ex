defmodule Robot.Localiser.MonteCarlo.Readings do
  @moduledoc false
  # Packs what the sonars have heard for the kernels of `Robot.Localiser.MonteCarlo`, and the likelihoods of what they hear. Pure.
  alias Hal.Pose
  alias Robot.Localiser.Walls
  alias Robot.Percept

  # Directions across a cone, as shares of half of it: the axis first and the borders last.
  @rays [0.0, -0.5, 0.5, -1.0, 1.0]
  # Ranges count from these on and up to these (metres); walls are looked for so much farther than the range.
  @near 0.2
  @far 4.5
  @beyond 0.8
  # The likelihood of a range (its standard deviation in metres): by the wall, by something before it, by neither or by an
  # echo that was thrown elsewhere. Readings at one place have errors in common: a share of each logarithm counts.
  @sd 0.15
  @before 0.15
  @behind 0.05
  @elsewhere 0.35
  @damping 0.3
  @entries 300

  table = fn behind ->
    for k <- -@entries..@entries, into: <<>> do
      off = k * 0.02
      other = if k < 0, do: @before, else: behind
      likely = (1 - other) * :math.exp(-off * off / (2 * @sd * @sd)) + other
      <<round(1024 * @damping * :math.log(likely))::16-signed-native>>
    end
  end

  @tables table.(@behind) <> table.(@elsewhere)

  @doc "The tables of `Robot.Localiser.MonteCarlo.Reference.weigh/4`."
  @spec tables() :: binary()
  def tables, do: @tables

  @doc """
  The readings of a percept that no other robot explains, as the kernels take them, and how many of them count: those of an echo.
  `pose` is where the robot believes to be among the others.
  """
  @spec pack(Percept.t(), Pose.t()) :: {binary(), counting :: non_neg_integer()}
  def pack(%Percept{profile: profile, sonar: ranges} = percept, pose) do
    far = min(@far, profile.sonar_max)

    readings =
      for {mount, range} <- Enum.zip(profile.sonars, ranges),
          is_number(range) and range > @near,
          not Walls.others?(percept, Pose.compose(pose, mount), range) do
        echo? = range < far
        rays = for share <- @rays, do: mount.heading + share * profile.sonar_cone / 2
        rays = for angle <- rays, part <- [:math.cos(angle), :math.sin(angle)], do: part
        range = min(range, far) * 1.0
        most = if echo?, do: range + @beyond, else: far * 1.0
        {echo?, [mount.x, mount.y] ++ rays ++ [range, most, if(echo?, do: 1.0, else: 0.0)]}
      end

    packed = for {_echo?, numbers} <- readings, n <- numbers, into: <<>>, do: <<n::float-native>>
    {packed, Enum.count(readings, &elem(&1, 0))}
  end
end
