defmodule Hal.Pose do
  @moduledoc """
  Holds a position in metres and a heading in the plane: radians counter-clockwise from +x, in `(-pi, pi]`.

  Frames as in REP-105: `map` (shared by the fleet), `odom` (one robot's wheels), `base_link` (a
  robot's body: x forward, y left). Pure.
  """

  # Called more often than anything else of a robot.
  @compile {:inline, root: 2, wrap: 1}

  @enforce_keys [:x, :y, :heading]
  defstruct @enforce_keys

  @type t :: %__MODULE__{x: float(), y: float(), heading: float()}
  @type point :: {x :: float(), y :: float()}

  @pi :math.pi()
  @two_pi 2 * :math.pi()

  @doc """
  A pose from numbers; the heading is wrapped.

      iex> Hal.Pose.new(1, 2)
      %Hal.Pose{x: 1.0, y: 2.0, heading: 0.0}
  """
  @spec new(number(), number(), number()) :: t()
  def new(x, y, heading \\ 0.0),
    do: %__MODULE__{x: x * 1.0, y: y * 1.0, heading: wrap(heading * 1.0)}

  @doc """
  The same angle in (-pi, pi].

      iex> Hal.Pose.wrap(3 * :math.pi()) == :math.pi()
      true
      iex> Hal.Pose.wrap(-:math.pi()) == :math.pi()
      true
  """
  @spec wrap(float()) :: float()
  def wrap(angle) when angle > -@pi and angle <= @pi, do: angle

  def wrap(angle) do
    rest = :math.fmod(angle, @two_pi)

    cond do
      rest > @pi -> rest - @two_pi
      rest <= -@pi -> rest + @two_pi
      true -> rest
    end
  end

  @doc """
  The position of a pose.

      iex> Hal.Pose.point(Hal.Pose.new(1, 2, 3))
      {1.0, 2.0}
  """
  @spec point(t()) :: point()
  def point(%__MODULE__{x: x, y: y}), do: {x, y}

  @doc """
  The distance between two positions, in metres.

      iex> Hal.Pose.distance({0.0, 0.0}, Hal.Pose.new(3, 4))
      5.0
  """
  @spec distance(t() | point(), t() | point()) :: float()
  def distance(%__MODULE__{x: ax, y: ay}, {bx, by}), do: root(bx - ax, by - ay)
  def distance({ax, ay}, {bx, by}), do: root(bx - ax, by - ay)
  def distance({ax, ay}, %__MODULE__{x: bx, y: by}), do: root(bx - ax, by - ay)

  def distance(%__MODULE__{x: ax, y: ay}, %__MODULE__{x: bx, y: by}),
    do: root(bx - ax, by - ay)

  defp root(x, y), do: :math.sqrt(x * x + y * y)

  @doc """
  The direction to a position, relative to the heading of a pose: 0 is ahead, positive is left.

      iex> Hal.Pose.bearing(Hal.Pose.new(0, 0, :math.pi() / 2), {0.0, 2.0})
      0.0
  """
  @spec bearing(t(), t() | point()) :: float()
  def bearing(%__MODULE__{x: x, y: y, heading: heading}, {px, py}),
    do: wrap(:math.atan2(py - y, px - x) - heading)

  def bearing(%__MODULE__{} = pose, %__MODULE__{x: x, y: y}), do: bearing(pose, {x, y})

  @doc """
  Converts a pose from the frame of `base` to the frame that `base` is given in.

      iex> Hal.Pose.compose(Hal.Pose.new(1, 2), Hal.Pose.new(2, 0, 0.5))
      Hal.Pose.new(3, 2, 0.5)
  """
  @spec compose(t(), t()) :: t()
  def compose(%__MODULE__{} = base, %__MODULE__{} = inner) do
    {x, y} = place(base, {inner.x, inner.y})
    %__MODULE__{x: x, y: y, heading: wrap(base.heading + inner.heading)}
  end

  @doc """
  Converts a point from the frame of `base` to the frame that `base` is given in.

      iex> Hal.Pose.place(Hal.Pose.new(1, 1), {2.0, 0.5})
      {3.0, 1.5}
  """
  @spec place(t(), point()) :: point()
  def place(%__MODULE__{x: x, y: y, heading: heading}, {px, py}) do
    c = :math.cos(heading)
    s = :math.sin(heading)
    {x + c * px - s * py, y + s * px + c * py}
  end

  @doc """
  `pose` in the frame of `base`: the inverse of `compose/2`.

      iex> Hal.Pose.relative(Hal.Pose.new(1, 1), Hal.Pose.new(3, 1, 0.5))
      Hal.Pose.new(2, 0, 0.5)
  """
  @spec relative(t(), t()) :: t()
  def relative(%__MODULE__{} = base, %__MODULE__{} = pose) do
    c = :math.cos(base.heading)
    s = :math.sin(base.heading)
    dx = pose.x - base.x
    dy = pose.y - base.y

    %__MODULE__{
      x: c * dx + s * dy,
      y: c * dy - s * dx,
      heading: wrap(pose.heading - base.heading)
    }
  end
end
