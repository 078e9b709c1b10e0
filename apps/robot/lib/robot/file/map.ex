defmodule Robot.File.Map do
  @moduledoc false
  # Reads the map of a robot file: the path of a description as map_server writes it, which is relative to the robot
  # file's folder (`Nav.MapFile`).
  alias Hal.Options.Type
  alias Hal.Pose
  alias Nav.{Grid, MapFile}

  @what "the path of a floor plan's description, \"FILE.yaml\","

  @typedoc "Reads a description; an error is one line."
  @type reader :: (Path.t() -> {:ok, MapFile.t()} | {:error, String.t()})

  @doc "The option type of a map, for a table of `Hal.Options`."
  @spec type(reader()) :: Type.t()
  def type(read), do: {:check, &check(&1, read), @what}

  defp check(path, read) do
    with {:ok, path} <- Type.read({:path, @what}, path),
         do: if(path =~ ~r/\.ya?ml\z/i, do: read.(path), else: false)
  end

  @doc """
  Why a robot of this radius (metres) cannot start at this pose of a map: `nil` if it can.

      iex> grid = Nav.Grid.new(<<0, 0, 0, 1>>, {4, 1}, 0.5, {0.0, 0.0}, closed?: false)
      iex> map = %Nav.MapFile{file: "floor.yaml", grid: grid}
      iex> for x <- [0.2, 1.7], do: Robot.File.Map.start(map, Hal.Pose.new(x, 0.2))
      [nil, "expected floor of the map floor.yaml, got {1.7, 0.2}: there is a wall"]
  """
  @spec start(MapFile.t() | nil, Pose.t()) :: String.t() | nil
  def start(nil, _pose), do: nil

  def start(%MapFile{file: file, grid: grid}, %Pose{x: x, y: y}) do
    {i, j} = Grid.index(grid, {x, y})

    cond do
      Grid.clearance(grid, {x, y}) > 0.0 -> nil
      Grid.inside?(grid, i, j) -> refusal(file, {x, y}, "there is a wall")
      true -> refusal(file, {x, y}, "it is outside of it")
    end
  end

  defp refusal(file, {x, y}, why),
    do: "expected floor of the map #{file}, got {#{x}, #{y}}: #{why}"
end
