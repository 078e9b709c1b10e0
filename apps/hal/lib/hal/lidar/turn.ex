defmodule Hal.Lidar.Turn do
  @moduledoc """
  Gathers what a lidar measures one after the other into a scan of rays that are equally far apart. Pure. A lidar that turns a little
  faster or slower gives more or fewer measurements, at other angles each time; of those that fall to one ray the nearest counts.
  """
  alias Hal.Scan

  @silent Scan.silent()

  @typedoc "The direction from the lidar, radians, left positive, and millimetres; 0 without an answer."
  @type measured :: {float(), 0..65_535}

  @doc """
  The scan of these measurements, in any order, with so many rays.

      iex> scan = Hal.Lidar.Turn.scan([{0.1, 900}, {-0.1, 800}, {0.05, 0}, {1.6, 0}], 4)
      iex> for <<mm::16 <- scan.ranges>>, do: mm
      [0, 0, 800, 65535]
      iex> scan.start + 2 * scan.step
      0.0
  """
  @spec scan([measured()], rays :: pos_integer()) :: Scan.t()
  def scan(measured, rays) do
    step = 2 * :math.pi() / rays

    nearest =
      for {angle, mm} <- measured, reduce: %{} do
        nearest ->
          ray = Integer.mod(round((angle + :math.pi()) / step), rays)
          mm = if mm == 0, do: @silent, else: mm
          Map.update(nearest, ray, mm, &min(&1, mm))
      end

    ranges = for ray <- 0..(rays - 1), into: <<>>, do: <<Map.get(nearest, ray, 0)::16>>
    %Scan{start: -:math.pi(), step: step, ranges: ranges}
  end
end
