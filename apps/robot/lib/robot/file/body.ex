defmodule Robot.File.Body do
  @moduledoc """
  Reads the body of a robot from a table of keys: shape, wheel base, limits, sensors with their poses, camera. It stands under
  `body:` of a robot's file, or is a file of its own (`Robot.File.Bodies`). Pure.

  A round body has a `radius:`; a box has `length:` and `width:`, with `offset:`, how far its middle is ahead of the wheels'
  axle, and its `radius:` is worked out from its corners unless it is given, such as for corners that are cut off. What
  else a whole body needs is `wheel_base:` and the greatest speeds; what is not given of sensors is not there.
  """
  alias Hal.{Pose, Profile}
  alias Hal.Options.Type
  alias Robot.File.{Reader, Terms}

  @what "body"
  # A given radius is rounded.
  @rounded_m 0.001

  @doc "The option type of a body: of all keys, none of which must be given."
  @spec type() :: Type.t()
  def type do
    {:keys,
     about: {:text, "what people call it, such as \"a TurtleBot3 Burger\","},
     mass: {:number, 0.1, 1_000.0, "kg"},
     board:
       {:or, nil, {:one_of, [:kobuki, :create, :turtlebot3_burger, :turtlebot3_waffle, :arduino]}},
     radius: {:number, 0.05, 1.5, "m"},
     length: {:number, 0.1, 2.0, "m"},
     width: {:number, 0.1, 2.0, "m"},
     offset: {:number, -1.0, 1.0, "m"},
     height: {:number, 0.05, 2.5, "m"},
     wheel_base: {:number, 0.05, 2.0, "m"},
     limits: limits(),
     sonars: {:list, pose(2.0), 64},
     sonar_min: {:number, 0.0, 1.0, "m"},
     sonar_max: {:number, 0.5, 12.0, "m"},
     sonar_cone: {:number, 0.02, 1.6, "rad"},
     scan: {:or, nil, {:keys, scan()}},
     irs: {:list, pose(2.0), 32},
     ir_max: {:number, 0.05, 6.0, "m"},
     bumpers: {:integer, 0, 16},
     bumper_span: {:number, 0.1, 2 * :math.pi(), "rad"},
     camera: {:or, nil, {:keys, camera()}}}
  end

  defp scan do
    [
      pose: pose(2.0),
      rays: {:integer, 4, 4_096},
      field_of_view: {:number, 0.1, 2 * :math.pi(), "rad"},
      min: {:number, 0.0, 1.0, "m"},
      max: {:number, 0.5, 60.0, "m"},
      period: {:number, 0.01, 1.0, "s"},
      model: {:or, nil, {:one_of, [:lds01, :lds02, :rplidar]}}
    ]
  end

  defp camera do
    [
      width: {:integer, 16, 4_096},
      height: {:integer, 16, 4_096},
      field_of_view: {:number, 0.05, 3.0, "rad"},
      mount_height: {:number, 0.0, 3.0, "m"},
      max_pan: {:number, 0.0, 3.15, "rad"},
      max_tilt: {:number, 0.0, 1.58, "rad"},
      pan_rate: {:number, 0.01, 10.0, "rad/s"},
      tilt_rate: {:number, 0.01, 10.0, "rad/s"}
    ]
  end

  @doc "The option type of speeds and accelerations: what a body can do, and what a robot's file lowers it to."
  @spec limits() :: Type.t()
  def limits do
    {:keys,
     max_linear: {:number, 0.01, 10.0, "m/s"},
     max_turn: {:number, 0.01, 10.0, "rad/s"},
     max_acceleration: {:number, 0.01, 10.0, "m/s2"},
     max_turn_acceleration: {:number, 0.01, 10.0, "rad/s2"}}
  end

  @doc "The option type of a pose on a body or a floor, up to so many metres from its origin."
  @spec pose(most :: number()) :: Type.t()
  def pose(most) do
    {:check, &place(&1, most),
     "{x, y, heading}, metres up to #{most} and radians, such as {1.0, 0.5, deg(90)},"}
  end

  defp place({x, y, heading}, most)
       when is_number(x) and is_number(y) and is_number(heading) and abs(x) <= most and
              abs(y) <= most and abs(heading) <= 100,
       do: {:ok, Pose.new(x, y, heading)}

  defp place(_other, _most), do: false

  @doc """
  The body of a text, a file of its own; `file` is its name in messages.

      iex> text = "[radius: 0.2, wheel_base: 0.3,\\n limits: [max_linear: 0.4]]"
      iex> Robot.File.Body.parse(text, :rover, "rover.exs")
      {:error, ["rover.exs:2: limits.max_turn: is missing: a whole body says how fast it turns"]}
  """
  @spec parse(String.t(), name :: atom(), file :: String.t()) ::
          {:ok, Profile.t()} | {:error, [String.t(), ...]}
  def parse(text, name, file) do
    with {:ok, tree} <- Reader.read(text, @what),
         {:ok, values} <- Terms.check(tree, type()),
         {:ok, profile} <- whole(name, values, tree) do
      {:ok, profile}
    else
      {:error, {line, text}} -> {:error, ["#{file}:#{line}: #{text}"]}
      {:error, problems} -> {:error, Reader.lines(problems, file)}
    end
  end

  defp whole(name, values, tree) do
    with {:error, problems} <- build(name, values, nil), do: {:error, Terms.at(problems, tree)}
  end

  @doc """
  The body of these values: a whole one, or with a base that one with the changes.

      iex> {:ok, box} = Robot.File.Body.build(:rover, [length: 0.4, width: 0.3, wheel_base: 0.25,
      ...>   limits: [max_linear: 0.4, max_turn: 1.5]], nil)
      iex> {box.radius, box.sonars, box.bumpers, box.camera}
      {0.25, [], 0, nil}
      iex> {:ok, slow} = Robot.File.Body.build(:rover, [limits: [max_linear: 0.2]], box)
      iex> slow == %{box | max_linear: 0.2}
      true
  """
  @spec build(name :: atom(), keyword(), base :: Profile.t() | nil) ::
          {:ok, Profile.t()} | {:error, [Type.problem(), ...]}
  def build(name, values, nil) do
    case missing(values) do
      [] ->
        plain = %{name: name, sonars: [], bumpers: 0, camera: nil}
        shape = values |> Map.new() |> shape()

        held(
          timed(struct!(Profile, plain |> Map.merge(shape) |> Map.merge(changes(values, nil))))
        )

      problems ->
        {:error, problems}
    end
  end

  def build(_name, values, %Profile{} = base),
    do: {:ok, base |> struct!(changes(values, base)) |> timed()}

  defp missing(values) do
    limits = Keyword.get(values, :limits, [])
    box? = Keyword.has_key?(values, :length) and Keyword.has_key?(values, :width)
    round? = Keyword.has_key?(values, :radius) and values[:length] == values[:width]

    for {false, path, text} <- [
          {box? or round?, ["radius"],
           "is missing: a whole body has a radius, or a length and a width"},
          {Keyword.has_key?(values, :wheel_base), ["wheel_base"],
           "is missing: a whole body says how far its wheels are apart"},
          {Keyword.has_key?(limits, :max_linear), ["limits", "max_linear"],
           "is missing: a whole body says how fast it drives"},
          {Keyword.has_key?(limits, :max_turn), ["limits", "max_turn"],
           "is missing: a whole body says how fast it turns"}
        ],
        do: {path, text}
  end

  defp shape(%{length: length, width: width} = values) do
    far = abs(Map.get(values, :offset, 0.0)) + length / 2
    %{radius: :math.sqrt(far * far + width * width / 4)}
  end

  defp shape(%{radius: radius}), do: %{length: 2 * radius, width: 2 * radius}

  # What a lidar has seen is as old as its turn.
  defp timed(%Profile{scan: nil} = profile), do: %{profile | sonar_round_s: 0.0}
  defp timed(profile), do: %{profile | sonar_round_s: profile.scan.period * 1.0}

  # The radius holds what it is drawn with, but for corners.
  defp held(%Profile{length: length, width: width, offset: offset, radius: radius} = profile) do
    least = max(abs(offset) + length / 2, width / 2)

    if radius + @rounded_m >= least,
      do: {:ok, profile},
      else:
        {:error,
         [
           {["radius"],
            "expected at least #{Float.round(least, 3)}, within which its sides are, got #{radius}"}
         ]}
  end

  defp changes(values, base) do
    {limits, values} = Keyword.pop(values, :limits, [])
    {camera, scan} = if base, do: {base.camera, base.scan}, else: {nil, nil}

    Map.new(limits ++ values, fn
      {:scan, keys} when is_list(keys) ->
        {:scan, Map.merge(scan || Profile.scan(), Map.new(keys))}

      {:camera, nil} ->
        {:camera, nil}

      {:camera, keys} ->
        {:camera, Map.merge(camera || Profile.camera(), Map.new(keys))}

      same ->
        same
    end)
  end
end
