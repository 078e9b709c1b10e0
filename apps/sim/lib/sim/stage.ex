defmodule Sim.Stage do
  @moduledoc """
  Reads a world file of Stage 3 or 4: walls, robots, a landmark, balls and boxes, marks. Pure but for reading the files.

  What Stage has and worlds here do not is left out, and told once each in `notes`. Places are Stage's own: metres, x to the
  right, y up; headings are radians here.
  """
  alias Hal.Pose
  alias Sim.Stage.{Colours, Entities, Robot, Shape, Values}

  @most_bytes 4_000_000
  @most_robots 1_000
  # Metres: how large a yellow thing may be to be a landmark, an orange one a ball, a blue one a box.
  @landmark 1.0
  @ball {0.06, 0.6}
  @box {0.1, 2.0}
  # So far before its model a mark hangs.
  @before 0.03

  @enforce_keys [:file]
  defstruct @enforce_keys ++
              [walls: [], robots: [], landmark: nil, balls: [], boxes: [], marks: [], notes: []]

  @typedoc """
  A wall: a picture with its pose and its size in metres, looked for beside the files, with walls along its edges or
  without; or a polygon. What is dark in a picture fills the size, as in Stage.
  """
  @type wall ::
          {:bitmap, String.t(), [Path.t()], Entities.at(), Pose.t(), {float(), float()},
           boundary? :: boolean()}
          | {:polygon, [Pose.point()]}

  @typedoc "Balls are `{x, y, radius}`, boxes `{pose, length, width}`, marks `{id, pose, where the file says so}`; `notes` are lines."
  @type t :: %__MODULE__{
          file: Path.t(),
          walls: [wall()],
          robots: [Robot.t()],
          landmark: Pose.point() | nil,
          balls: [{float(), float(), float()}],
          boxes: [{Pose.t(), float(), float()}],
          marks: [{pos_integer(), Pose.t(), Entities.at()}],
          notes: [String.t()]
        }

  @doc """
  The world of a file; the error is one line.

      iex> Sim.Stage.open("no/such.world")
      {:error, "no/such.world: no such file or directory"}
  """
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(file), do: read(file, &text/1)

  # Reading a device or a pipe would never end.
  defp text(file) do
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= @most_bytes <-
           File.stat(file),
         {:ok, text} <- File.read(file) do
      {:ok, text}
    else
      {:ok, %File.Stat{type: :regular, size: size}} ->
        {:error, "has #{size} bytes: up to #{@most_bytes} are read"}

      {:ok, %File.Stat{type: type}} ->
        {:error, "is a #{type}, not a file"}

      {:error, reason} ->
        {:error, to_string(:file.format_error(reason))}
    end
  end

  @doc """
  The same with another way of reading files.

      iex> read = fn _file -> {:ok, "position (name \\"r0\\" pose [1 2 0 90] gripper ())"} end
      iex> {:ok, world} = Sim.Stage.read("a.world", read)
      iex> {hd(world.robots).name, Hal.Pose.point(hd(world.robots).pose), world.notes}
      {"r0", {1.0, 2.0}, ["a.world:1: gripper is left out"]}
  """
  @spec read(Path.t(), Entities.read()) :: {:ok, t()} | {:error, line :: String.t()}
  def read(file, read) do
    with {:ok, %{properties: properties, entities: entities}} <- Entities.read(file, read),
         :ok <- Enum.find_value(entities, :ok, &with(:ok <- Values.check(&1), do: nil)) do
      finder? = Enum.any?(entities, &Robot.finder?/1)

      state = %{
        world: %__MODULE__{file: file},
        told: %{},
        finder?: finder?,
        frame: Pose.new(0, 0),
        part?: false
      }

      state = odd(state, properties, world_properties())
      state = Enum.reduce(entities, state, &visit/2)
      whole(state)
    end
  end

  defp whole(%{world: %{robots: []} = world}),
    do: {:error, "#{world.file}: there is no robot in it: no model is a position"}

  defp whole(%{world: %{robots: robots} = world}) when length(robots) > @most_robots,
    do: {:error, "#{world.file}: #{length(robots)} robots: at most #{@most_robots} are allowed"}

  defp whole(%{world: world, told: told}) do
    notes =
      for {_what, {{file, line, _column}, text}} <- told,
          do: {file, line, "#{file}:#{line}: #{text}"}

    {:ok,
     %{
       world
       | walls: Enum.reverse(world.walls),
         robots: Enum.reverse(world.robots),
         balls: Enum.reverse(world.balls),
         boxes: Enum.reverse(world.boxes),
         marks: Enum.reverse(world.marks),
         notes: notes |> Enum.sort() |> Enum.map(&elem(&1, 2))
     }}
  end

  # What shows Stage's window, or is Stage's own machinery, is no part of a world.
  defp visit(%{type: "window"}, state), do: state

  defp visit(%{type: type} = entity, state) when type in ["model", "floorplan"] do
    state
    |> odd(
      entity.properties,
      ~w(bitmap boundary color color_rgba fiducial_return name obstacle_return
         origin pose ranger_return size)
    )
    |> model(entity, placed(entity, state))
    |> inside(entity)
  end

  defp visit(%{type: "position"} = entity, state) do
    {robot, left_out} = Robot.read(entity, Pose.compose(state.frame, Values.pose(entity, "pose")))

    state
    |> odd(
      entity.properties,
      ~w(acceleration_bounds drive mass name origin pose size velocity_bounds
         obstacle_return ranger_return fiducial_return blob_return)
    )
    |> parts(entity)
    |> then(
      &Enum.reduce(left_out, &1, fn {at, what, why}, state ->
        tell(state, what, at, ": " <> why)
      end)
    )
    |> put(:robots, if(state.finder?, do: robot, else: %{robot | mark: nil}))
  end

  # Drawn where there are blocks in a model, and read with it.
  defp visit(%{type: "block"}, state), do: state
  defp visit(entity, state), do: tell(state, entity.type, entity.at, "")

  # What is in a model stands in its frame, and is a part of it.
  defp inside(%{frame: frame} = state, entity) do
    inner = %{state | frame: Pose.compose(frame, Values.pose(entity, "pose")), part?: true}
    %{Enum.reduce(entity.entities, inner, &visit/2) | frame: frame, part?: state.part?}
  end

  @sensor ~w(fov pose range range_max range_min samples size view name color color_rgba)
  @known %{
    "ranger" => @sensor ++ ~w(scount spose ssize sview),
    "laser" => @sensor,
    "sensor" => @sensor,
    "blobfinder" => ~w(fov pose size name color),
    "camera" => ~w(fov pose size name color),
    "fiducial" => ~w(name pose size color),
    "fiducialfinder" => ~w(name pose size color),
    "bumper" => ~w(name pose size color),
    "block" => ~w(points point z color)
  }

  # The parts of a robot that it does not have here.
  defp parts(state, entity) do
    Enum.reduce(entity.entities, state, fn part, state ->
      case Map.fetch(@known, part.type) do
        {:ok, known} -> state |> odd(part.properties, known) |> parts(part)
        :error -> state |> tell(part.type, part.at, "") |> parts(part)
      end
    end)
  end

  defp world_properties,
    do:
      ~w(interval_real interval_sim name paused quit_time resolution show_clock show_clock_interval
         size speedup threads)

  # Of the properties those that count nothing for what is seen, and no more.
  defp odd(state, properties, known) do
    Enum.reduce(properties, state, fn {name, {at, _value}}, state ->
      base = Values.base(name)
      if base in known or shown?(base), do: state, else: tell(state, base, at, "")
    end)
  end

  defp shown?("gui_" <> _rest), do: true
  defp shown?("trail_" <> _rest), do: true
  defp shown?("show_" <> _rest), do: true
  defp shown?(name), do: name in ["alwayson", "laser_return"]

  # Once each, where it is first.
  defp tell(state, what, at, why) do
    told =
      Map.update(
        state.told,
        what,
        {at, "#{what} is left out#{why}"},
        &min(&1, {at, "#{what} is left out#{why}"})
      )

    %{state | told: told}
  end

  defp put(%{world: world} = state, key, value),
    do: %{state | world: Map.update!(world, key, &[value | &1])}

  defp placed(entity, state) do
    state.frame
    |> Pose.compose(Values.pose(entity, "pose"))
    |> Pose.compose(Values.pose(entity, "origin"))
  end

  defp model(state, entity, pose) do
    {length, width, _height} = Values.size(entity)
    colour = if state.part?, do: :other, else: Colours.class(Values.colour(entity))

    state =
      cond do
        Values.text(entity, "bitmap") ->
          solid(state, entity, {:bitmap, pose, {length, width}})

        not solid?(entity) ->
          tell(state, "what neither stops robots nor is seen by rangers", entity.at, "")

        landmark?(entity, colour, max(length, width)) ->
          landmark(state, entity.at, Pose.point(pose))

        colour == :orange and within?(length, @ball) and abs(length - width) < 0.1 * length ->
          put(state, :balls, {pose.x, pose.y, length / 2})

        colour == :blue and within?(length, @box) and within?(width, @box) ->
          put(state, :boxes, {pose, length, width})

        true ->
          solid(state, entity, {:shape, pose})
      end

    mark(state, entity, pose, length)
  end

  defp within?(value, {least, most}), do: value >= least and value <= most

  defp solid?(entity) do
    Values.number(entity, "obstacle_return", 1.0) != 0.0 or
      Values.number(entity, "ranger_return", 1.0) > 0.0
  end

  defp landmark?(entity, colour, side) do
    named? = Enum.any?([Values.text(entity, "name") | entity.names], &(&1 == "landmark"))
    side <= @landmark and (named? or colour == :yellow)
  end

  defp landmark(%{world: %{landmark: nil} = world} = state, _at, place),
    do: %{state | world: %{world | landmark: place}}

  defp landmark(state, at, _place), do: tell(state, "a second landmark", at, ": a world has one")

  defp solid(state, entity, {:bitmap, pose, size}) do
    if solid?(entity) do
      {file, _line, _column} = at = Values.at(entity, "bitmap")
      boundary? = Values.number(entity, "boundary", 0.0) != 0.0
      name = Values.text(entity, "bitmap")
      put(state, :walls, {:bitmap, name, [file, state.world.file], at, pose, size, boundary?})
    else
      tell(state, "what neither stops robots nor is seen by rangers", entity.at, "")
    end
  end

  defp solid(state, entity, {:shape, pose}) do
    Enum.reduce(Shape.polygons(entity), state, fn points, state ->
      put(state, :walls, {:polygon, Enum.map(points, &Pose.place(pose, &1))})
    end)
  end

  # A mark hangs before its model, and faces where that does. Without a finder no robot looks for one.
  defp mark(%{finder?: false} = state, _entity, _pose, _length), do: state

  defp mark(state, entity, pose, length) do
    case Values.mark(entity) do
      nil ->
        state

      id ->
        {x, y} = Pose.place(pose, {length / 2 + @before, 0.0})

        put(
          state,
          :marks,
          {id, Pose.new(x, y, pose.heading), Values.at(entity, "fiducial_return")}
        )
    end
  end
end
