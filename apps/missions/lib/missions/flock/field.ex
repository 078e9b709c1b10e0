defmodule Missions.Flock.Field do
  @moduledoc """
  Computes the accelerations of flocking with obstacles and a navigational term (Olfati-Saber 2006, algorithm 3), for
  one robot at `q` with velocity `p`. Pure; metres, m/s, m/s2.

      u = c_a sum phi_a(|q_j - q|_s) n_j + c_v sum a_j (p_j - p)          its neighbours j
        + c_b sum phi_b(|q_k - q|_s) n_k - c_w sum b_k (p n_k) n_k        obstacles k
        + c_g (p_g + v s1((q_g - q) / w) - p)                             the guide g

  with `|z|_s = (sqrt(1 + e |z|^2) - 1) / e`, `n = (q_j - q) / sqrt(1 + e |q_j - q|^2)` and `s1(z) = z / sqrt(1 + |z|^2)`. An
  obstacle is a virtual agent at the point of an echo, which moves along the obstacle as the robot does. `phi_a` is zero at the
  spacing, and from `reach/1` on, so that a robot looks at its neighbours only.

  | sign | here | meaning |
  |---|---|---|
  | e | 0.1 | of the norm |
  | h | 0.2, of obstacles 0.9 | the share of its range in which a bump is 1 |
  | a, b | 5, 5 | attraction and repulsion at most |
  | c_a, c_v, c_b, c_w, c_g | 0.3, 0.3, 0.6, 0.3, 1.0 | what of these wheels can do |
  """
  alias Hal.Pose

  @e 0.1
  @h 0.2
  @h_obstacle 0.9
  # a = b = 5, scaled to what wheels can do: m/s2 of one neighbour at most.
  @strength 5.0
  @near_gain 0.3
  @align_gain 0.3
  @obstacle_gain 0.6
  @along_gain 0.3
  @goal_gain 1.0
  # A robot's neighbours are within this many spacings; the next ring of a lattice is at 1.73.
  @reach 1.4

  @type vector :: {float(), float()}
  @typedoc "Another member of the flock."
  @type agent :: %{at: Pose.point(), velocity: vector()}

  @doc "How far a robot's neighbours are at most, for this spacing (metres)."
  @spec reach(float()) :: float()
  def reach(spacing), do: @reach * spacing

  @doc """
  What the neighbours do: spacing and the same velocity.

      iex> two = fn far -> Missions.Flock.Field.neighbours({0.0, 0.0}, {0.0, 0.0}, [%{at: {far, 0.0}, velocity: {0.0, 0.0}}], 1.2) end
      iex> for far <- [0.8, 1.2, 1.4, 2.0], do: two.(far) |> elem(0) |> Float.round(2) |> Kernel.+(0.0)
      [-0.41, 0.0, 0.13, 0.0]
  """
  @spec neighbours(Pose.point(), vector(), [agent()], spacing :: float()) :: vector()
  def neighbours({x, y}, {px, py}, agents, spacing) do
    far = norm(reach(spacing))
    wanted = norm(spacing)

    Enum.reduce(agents, {0.0, 0.0}, fn %{at: {ax, ay}, velocity: {vx, vy}}, {ux, uy} ->
      {dx, dy} = {ax - x, ay - y}
      square = dx * dx + dy * dy
      z = (:math.sqrt(1 + @e * square) - 1) / @e
      bump = bump(z / far, @h)
      # phi with a = b and c = 0.
      push = @near_gain * bump * @strength * s1(z - wanted) / :math.sqrt(1 + @e * square)
      follow = @align_gain * bump
      {ux + push * dx + follow * (vx - px), uy + push * dy + follow * (vy - py)}
    end)
  end

  @doc """
  What obstacles do, by the points of their echoes: away from those nearer than `range`, and along them.

      iex> alias Missions.Flock.Field
      iex> Field.obstacles({0.0, 0.0}, {0.3, 0.0}, [{1.5, 0.0}], 1.0)
      {0.0, 0.0}
      iex> {ux, +0.0} = Field.obstacles({0.0, 0.0}, {0.3, 0.0}, [{0.5, 0.0}], 1.0)
      iex> ux < 0
      true
  """
  @spec obstacles(Pose.point(), vector(), [Pose.point()], range :: float()) :: vector()
  def obstacles({x, y}, {px, py}, points, range) do
    far = norm(range)

    Enum.reduce(points, {0.0, 0.0}, fn {ax, ay}, {ux, uy} ->
      {dx, dy} = {ax - x, ay - y}
      distance = max(:math.sqrt(dx * dx + dy * dy), 1.0e-6)
      {nx, ny} = {dx / distance, dy / distance}
      z = norm(distance)
      bump = bump(z / far, @h_obstacle)
      push = @obstacle_gain * bump * (s1(z - far) - 1)
      # The virtual agent's velocity is the robot's without its part toward the obstacle.
      into = @along_gain * bump * max(px * nx + py * ny, 0.0)
      {ux + (push - into) * nx, uy + (push - into) * ny}
    end)
  end

  @doc """
  What the guide does, the agent that all follow, at `q` with velocity `p`: the same velocity, and toward it with `speed`
  from farther than `wide` metres, nearer more slowly.

      iex> alias Missions.Flock.Field
      iex> Field.guide({0.0, 0.0}, {0.3, 0.0}, {{0.0, 0.0}, {0.3, 0.0}}, 0.3, 1.0)
      {0.0, 0.0}
      iex> {ux, +0.0} = Field.guide({0.0, 0.0}, {0.0, 0.0}, {{2.0, 0.0}, {0.0, 0.0}}, 0.3, 1.0)
      iex> ux > 0
      true
  """
  @spec guide(Pose.point(), vector(), {Pose.point(), vector()}, float(), float()) :: vector()
  def guide({x, y}, {px, py}, {at, {vx, vy}}, speed, wide) do
    {dx, dy} = toward({x, y}, at, speed, wide)
    {@goal_gain * (vx + dx - px), @goal_gain * (vy + dy - py)}
  end

  @doc """
  The velocity from one point to another: `speed` if it is much farther than `slow` metres, 0 there.

      iex> Missions.Flock.Field.toward({0.0, 0.0}, {3.0, 4.0}, 0.3, 1.0e-9) |> elem(0) |> Float.round(3)
      0.18
  """
  @spec toward(Pose.point(), Pose.point(), speed :: float(), slow :: float()) :: vector()
  def toward({x, y}, {gx, gy}, speed, slow) do
    {dx, dy} = {(gx - x) / slow, (gy - y) / slow}
    scale = speed / :math.sqrt(1 + dx * dx + dy * dy)
    {scale * dx, scale * dy}
  end

  # The norm of a distance, which is smooth at 0 where the distance itself is not.
  defp norm(distance), do: (:math.sqrt(1 + @e * distance * distance) - 1) / @e

  defp s1(z), do: z / :math.sqrt(1 + z * z)

  defp bump(z, h) when z < h, do: 1.0
  defp bump(z, h) when z < 1, do: (1 + :math.cos(:math.pi() * (z - h) / (1 - h))) / 2
  defp bump(_z, _h), do: 0.0
end
