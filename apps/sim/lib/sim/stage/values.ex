defmodule Sim.Stage.Values do
  @moduledoc """
  Checks and reads the properties of a world file's models: numbers, texts, poses in metres and degrees, sizes, colours. Pure.

  All properties are checked once (`check/1`); then reading one gives its value or a default.
  """
  alias Hal.Pose
  alias Sim.Stage.{Colours, Entities}

  @longest 2_000

  # Properties that count, by their name without an index: how many numbers, or a text.
  @forms %{
    "acceleration_bounds" => {:numbers, 4..8},
    "bitmap" => :text,
    "blob_return" => {:numbers, 1..1},
    "boundary" => {:numbers, 1..1},
    "color" => :text,
    "color_rgba" => {:numbers, 3..4},
    "drive" => :text,
    "fiducial_return" => {:numbers, 1..1},
    "fov" => {:numbers, 1..2},
    "mass" => {:numbers, 1..1},
    "name" => :text,
    "obstacle_return" => {:numbers, 1..1},
    "origin" => {:numbers, 3..4},
    "point" => {:numbers, 2..2},
    "points" => {:numbers, 1..1},
    "pose" => {:numbers, 3..4},
    "range" => {:numbers, 1..2},
    "range_max" => {:numbers, 1..1},
    "range_min" => {:numbers, 1..1},
    "ranger_return" => {:numbers, 1..1},
    "samples" => {:numbers, 1..1},
    "size" => {:numbers, 2..4},
    "spose" => {:numbers, 3..3},
    "sview" => {:numbers, 3..3},
    "velocity_bounds" => {:numbers, 4..8},
    "view" => {:numbers, 3..3}
  }

  # What is left out may mean something else by the same names.
  @types ~w(model floorplan position ranger laser sensor blobfinder camera fiducial fiducialfinder bumper block)

  @doc """
  Whether the properties of an entity, and of those in it, are what their names say; else the first fault as one line.

      iex> at = {"a.world", 3, 1}
      iex> model = %{type: "model", names: ["model"], at: at, entities: [], properties: %{"size" => {at, [1.0, -1.0]}}}
      iex> Sim.Stage.Values.check(model)
      {:error, "a.world:3:1: size: expected more than 0 and at most 2000 m, got -1.0"}
  """
  @spec check(Entities.entity()) :: :ok | {:error, line :: String.t()}
  def check(%{type: type}) when type not in @types, do: :ok

  def check(%{properties: properties, entities: entities}) do
    fault =
      properties
      |> Enum.sort_by(fn {_name, {at, _value}} -> at end)
      |> Enum.find_value(fn {name, {at, value}} -> fault(base(name), value, at) end)

    cond do
      fault -> {:error, fault}
      true -> Enum.find_value(entities, :ok, &with(:ok <- check(&1), do: nil))
    end
  end

  defp fault(name, value, {file, line, column}) do
    with text when is_binary(text) <- wrong(name, @forms[name], value),
         do: "#{file}:#{line}:#{column}: #{name}: #{text}"
  end

  defp wrong(_name, nil, _value), do: nil
  defp wrong(_name, :text, value) when is_binary(value), do: nil
  defp wrong(_name, :text, value), do: "expected a text, got #{shown(value)}"

  defp wrong(name, {:numbers, count}, value) do
    numbers = List.wrap(value)

    cond do
      length(numbers) not in count or not Enum.all?(numbers, &is_float/1) ->
        "expected #{many(count)}, got #{shown(value)}"

      name == "size" and not Enum.all?(Enum.take(numbers, 2), &(&1 > 0.0 and &1 <= @longest)) ->
        odd = numbers |> Enum.take(2) |> Enum.find(&(&1 <= 0.0 or &1 > @longest))
        "expected more than 0 and at most #{@longest} m, got #{odd}"

      name in ["pose", "origin"] and Enum.any?(Enum.take(numbers, 2), &(abs(&1) > @longest)) ->
        "expected at most #{@longest} m from the origin, got #{shown(value)}"

      true ->
        nil
    end
  end

  defp many(%{first: 1, last: 1}), do: "a number"
  defp many(%{first: n, last: n}), do: "#{n} numbers"
  defp many(%{first: first, last: last}), do: "#{first} to #{last} numbers"

  defp shown(value) when is_list(value),
    do: "[" <> (value |> Enum.take(9) |> Enum.map_join(" ", &shown/1)) <> "]"

  defp shown(value) when is_binary(value), do: inspect(String.slice(value, 0, 40))
  defp shown(value), do: to_string(value)

  @doc "The name of a property without its index."
  @spec base(String.t()) :: String.t()
  def base(name), do: name |> String.split("[", parts: 2) |> hd()

  @doc "A number, or the first of several."
  @spec number(Entities.entity(), String.t(), default) :: float() | default when default: term()
  def number(entity, name, default), do: entity |> numbers(name, [default]) |> hd()

  @doc "Several numbers."
  @spec numbers(Entities.entity(), String.t(), default) :: [float()] | default
        when default: term()
  def numbers(entity, name, default) do
    case entity.properties do
      %{^name => {_at, value}} -> List.wrap(value)
      _none -> default
    end
  end

  @doc "A text, or `nil`."
  @spec text(Entities.entity(), String.t()) :: String.t() | nil
  def text(entity, name) do
    with {_at, text} <- entity.properties[name], do: text
  end

  @doc "Where a property stands, or the entity, if it has none of this name."
  @spec at(Entities.entity(), String.t()) :: Entities.at()
  def at(entity, name) do
    {at, _value} = Map.get(entity.properties, name, {entity.at, nil})
    at
  end

  @doc """
  A pose: of four numbers x, y, height and degrees, as in Stage 3 and 4; of three x, y and degrees, as in Stage 1 and 2. Without
  one it is the origin.

      iex> at = {"a.world", 1, 1}
      iex> model = %{type: "model", names: ["model"], at: at, entities: [], properties: %{"pose" => {at, [1.0, 2.0, 0.5, 180.0]}}}
      iex> Sim.Stage.Values.pose(model, "pose")
      Hal.Pose.new(1.0, 2.0, :math.pi())
  """
  @spec pose(Entities.entity(), String.t()) :: Pose.t()
  def pose(entity, name) do
    case numbers(entity, name, [0.0, 0.0, 0.0]) do
      [x, y, _height, degrees] -> Pose.new(x, y, radians(degrees))
      [x, y, degrees] -> Pose.new(x, y, radians(degrees))
    end
  end

  @doc "Length, width and height in metres; Stage's own where the file does not say it."
  @spec size(Entities.entity()) :: {float(), float(), float()}
  def size(entity) do
    case numbers(entity, "size", [0.4, 0.4]) do
      [length, width, height | _more] -> {length, width, height}
      [length, width] -> {length, width, 1.0}
    end
  end

  @doc "The colour, or `nil`."
  @spec colour(Entities.entity()) :: Colours.rgb() | nil
  def colour(entity) do
    case {numbers(entity, "color_rgba", nil), text(entity, "color")} do
      {[red, green, blue | _alpha], _name} -> {red, green, blue}
      {nil, nil} -> nil
      {nil, name} -> Colours.named(name)
    end
  end

  @doc "The id that finders of marks read, or `nil`: without one, and for what is none, such as 0."
  @spec mark(Entities.entity()) :: pos_integer() | nil
  def mark(entity) do
    id = entity |> number("fiducial_return", 0.0) |> trunc()
    if id > 0, do: id
  end

  @doc "Radians of degrees."
  @spec radians(float()) :: float()
  def radians(degrees), do: degrees * :math.pi() / 180
end
