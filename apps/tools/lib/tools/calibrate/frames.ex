defmodule Tools.Calibrate.Frames do
  @moduledoc false
  # Takes frames to calibrate a colour by: from any source that ffmpeg reads, or from a simulated camera (`sim`), which
  # sees the yellow landmark at 2 m and a red robot beside it.
  alias Hal.Camera.Source
  alias Hal.{Frame, Pose, Profile}
  alias Sim.World
  alias Vision.{Blobs, Colours}

  @of_cameras 10

  @doc """
  Reads frames, at least one: `count` of them, or with `nil` as many as the kind of source needs.
  """
  @spec take(String.t(), pos_integer() | nil) :: {:ok, [Frame.t(), ...]} | {:error, String.t()}
  def take("sim", count), do: {:ok, simulated(count || 1)}

  def take(source, count) do
    count = count || if(Source.kind(source) in [:file, :generator], do: 1, else: @of_cameras)
    # No blobs are wanted yet.
    {:ok, colours} = Colours.new([%{name: "None", y: {0, 0}, u: {0, 0}, v: {0, 0}}])
    me = self()
    ref = make_ref()

    with {:ok, _summary} <- Blobs.run(source, colours, &send(me, {ref, &1.frame}), frames: count) do
      case received(ref) do
        [] -> {:error, "#{source}: it has no frame"}
        frames -> {:ok, frames}
      end
    end
  end

  defp received(ref) do
    receive do
      {^ref, frame} -> [frame | received(ref)]
    after
      0 -> []
    end
  end

  defp simulated(count) do
    {:ok, map} = Sim.Floorplan.open("hall", 2)

    robots = [
      %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(0, 0)},
      %{id: :mag2, profile: Profile.magellan(), pose: Pose.new(2.5, -0.8)}
    ]

    [map: map, robots: robots, landmark: {2.0, 0.2}]
    |> World.new!()
    |> Stream.iterate(&World.step/1)
    |> Enum.take(count)
    |> Enum.map(&World.frame(&1, :mag1))
  end
end
