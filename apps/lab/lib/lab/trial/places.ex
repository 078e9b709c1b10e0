defmodule Lab.Trial.Places do
  @moduledoc """
  Says where the robots, the landmark and the objects of a run stand, and whether there is room for them: at the start, at the
  places that a script names, and where a person puts one. Pure.
  """
  alias Hal.Options.Suggest
  alias Hal.Pose
  alias Lab.Trial.Event
  alias Sim.{Floorplan, World}
  alias Sim.World.{Bodies, Object, Pushing}

  # How often starts are drawn again, and how far from objects they must be.
  @draws 50
  @next_seed 1_000_003
  @beside 0.1
  @radian :math.pi() / 180

  @typedoc "The path to what is wrong among the options, and what is wrong there."
  @type problem :: {path :: [String.t()], line :: String.t()}

  @doc "Checks that the landmark can stand at all these places (`nil`: no landmark)."
  @spec check_landmarks(Floorplan.t(), [Pose.point() | nil]) :: :ok | {:error, String.t()}
  def check_landmarks(map, places) do
    Enum.find_value(places, :ok, fn place ->
      case place && Floorplan.check_landmark(map, place) do
        {:error, line} -> {:error, line}
        _fine -> nil
      end
    end)
  end

  @doc "Its balls and boxes, by its checked options."
  @spec objects(map()) :: [Object.t()]
  def objects(options) do
    balls =
      for {ball, n} <- Enum.with_index(options.balls, 1) do
        [x, y | radius] = Tuple.to_list(ball)
        [id: "ball#{n}", kind: :ball, pose: Pose.new(x, y)] ++ Enum.zip([:radius], radius)
      end

    boxes =
      for {box, n} <- Enum.with_index(options.boxes, 1) do
        [x, y, degrees | sides] = Tuple.to_list(box)
        pose = Pose.new(x, y, degrees * @radian)
        [id: "box#{n}", kind: :box, pose: pose] ++ Enum.zip([:length, :width], sides)
      end

    Enum.map(balls ++ boxes, &Object.new!/1)
  end

  @doc "Whether they stand free of walls; a problem has the path to its option."
  @spec check_objects(Floorplan.t(), [Object.t()]) :: :ok | {:error, problem()}
  def check_objects(map, objects) do
    Enum.find_value(objects, :ok, fn %{id: id, kind: kind, pose: pose} = object ->
      unless Object.free?(object, map) do
        n = String.replace_prefix(id, "#{kind}", "")
        line = "#{id} cannot be at #{pose.x},#{pose.y} of map #{map.name}: there is a wall"
        {:error, {[if(kind == :ball, do: "balls", else: "boxes"), n], line}}
      end
    end)
  end

  @doc """
  Where the landmark and the robots start: poses that are given, or of the starts that further seeds give the first at which no robot
  stands on an object. The error is one line.
  """
  @spec choose(Floorplan.t(), [{atom(), float()}], map(), Pose.point() | :default | nil) ::
          {:ok, Pose.point() | nil, [Pose.t()]} | {:error, String.t()}
  def choose(map, bodies, %{start: [_ | _] = given} = options, landmark) do
    starts = for {x, y, degrees} <- given, do: Pose.new(x, y, degrees * @radian)

    with {:ok, landmark, _starts} <- landmark_beside(map, bodies, options, landmark),
         :ok <- check_starts(map, Enum.zip(bodies, starts), objects(options), landmark),
         do: {:ok, landmark, starts}
  end

  def choose(map, bodies, %{seed: seed} = options, landmark) do
    objects = objects(options)

    Enum.find_value(0..@draws, fn draw ->
      with {:ok, _landmark, starts} = places <-
             Floorplan.places(map, bodies, seed + draw * @next_seed, landmark) do
        stands? = fn {{_id, radius}, %{x: x, y: y}} ->
          Enum.any?(objects, &(elem(Object.gap(&1, {x, y, radius}), 0) < @beside))
        end

        if draw == @draws or not Enum.any?(Enum.zip(bodies, starts), stands?), do: places
      end
    end)
  end

  defp landmark_beside(map, bodies, options, :default),
    do: Floorplan.places(map, bodies, options.seed, :default)

  defp landmark_beside(_map, _bodies, _options, landmark), do: {:ok, landmark, nil}

  defp check_starts(map, robots, objects, landmark) do
    pole = if landmark, do: [{"the landmark", landmark, Floorplan.Landmark.radius()}], else: []

    robots
    |> Enum.reduce_while(pole, fn {{id, radius}, %{x: x, y: y}}, standing ->
      there =
        Enum.find_value(standing, fn {name, place, other} ->
          if Pose.distance(place, {x, y}) < radius + other, do: name
        end) ||
          Enum.find_value(objects, &if(elem(Object.gap(&1, {x, y, radius}), 0) < 0.0, do: &1.id))

      cond do
        there ->
          {:halt, "#{id} cannot start at #{x},#{y} of map #{map.name}: #{there} is there"}

        not Floorplan.free?(map, {x, y}, radius) ->
          {:halt, "#{id} cannot start at #{x},#{y} of map #{map.name}: there is a wall"}

        true ->
          {:cont, [{id, {x, y}, radius} | standing]}
      end
    end)
    |> case do
      line when is_binary(line) -> {:error, line}
      _standing -> :ok
    end
  end

  @doc "Whether there is room at the places that a script names; a problem has the path to its entry."
  @spec check_script(Floorplan.t(), map()) :: :ok | {:error, problem()}
  def check_script(map, options) do
    options.script
    |> Enum.with_index(1)
    |> Enum.find_value(:ok, fn {{_at_s, event}, n} ->
      with {:error, line} <- check_event(map, event, options),
           do: {:error, {["script", "#{n}"], line}},
           else: (_fine -> nil)
    end)
  end

  defp check_event(map, {:move, place}, _options), do: check_landmarks(map, [place])

  defp check_event(map, {:displace, who, {x, y, _deg}}, options),
    do: check_place(map, who, {x, y}, options.bodies)

  defp check_event(map, {:place, id, {x, y, degrees}}, options) do
    objects = objects(options)

    case Enum.find(objects, &(&1.id == id)) do
      nil ->
        {:error, "there is no #{id} in this run" <> Suggest.hint(id, Enum.map(objects, & &1.id))}

      object ->
        unless Object.free?(%{object | pose: Pose.new(x, y, degrees * @radian)}, map),
          do: {:error, "#{id} cannot be put at #{x},#{y} of map #{map.name}: there is a wall"}
    end
  end

  defp check_event(_map, _event, _options), do: :ok

  defp check_place(map, who, {x, y} = place, bodies) do
    ids = if who == :leader, do: Map.keys(bodies), else: [who]
    radius = ids |> Enum.map(&bodies[&1].radius) |> Enum.max()

    unless Floorplan.free?(map, place, radius),
      do: {:error, "#{who} cannot be put at #{x},#{y} of map #{map.name}: there is a wall"}
  end

  @doc """
  The event by which a person puts a robot, or an object of this name, elsewhere in the world as it is now; it faces where it
  did. The error is one line: there is no such object, or no room.
  """
  @spec put(World.t(), atom() | String.t(), Pose.point()) ::
          {:ok, Event.t()} | {:error, String.t()}
  def put(world, id, {x, y}) when is_binary(id) do
    with %Object{pose: pose} <- Enum.find(world.objects, &(&1.id == id)),
         {:ok, _world} <- Pushing.place(world, id, Pose.new(x, y, pose.heading)) do
      {:ok, {:place, id, {x, y, pose.heading / @radian}}}
    else
      nil -> {:error, "there is no #{id}"}
      error -> error
    end
  end

  def put(world, id, {x, y} = place) do
    %{pose: pose, profile: %{radius: radius}} = world.robots[id]

    free? =
      Floorplan.free?(world.map, place, radius) and not Bodies.occupied?(world, id, place) and
        Enum.all?(world.objects, &(elem(Object.gap(&1, {x, y, radius}), 0) >= 0.0))

    if free?,
      do: {:ok, {:displace, id, {x, y, pose.heading / @radian}}},
      else: {:error, "#{id} cannot be put at #{x},#{y}: there is no room"}
  end
end
