defmodule Robot.File.Schema do
  @moduledoc """
  Lists all keys of a robot file and their types, as one table of `Hal.Options`. Pure; `docs/robots.md` and
  `config/robots/template.exs` describe the same keys for people, and tests compare them.
  """
  alias Hal.{Pose, Profile}
  alias Hal.Options.Type
  alias Hal.RFlex.PowerSwitch
  alias Robot.File.{Colours, Device, RecordOptions}
  alias Robot.Fence

  @farthest 10_000
  @fleet for kind <- ~w(mag min), n <- 1..100, do: :"#{kind}#{n}"

  @typedoc """
  What the table needs from its caller: the names of the fleet, functions that read a colour
  file and a map, and the types of the keys that an app above this one defines.
  """
  @type context :: %{
          fleet: [atom(), ...],
          tables: [{:network | :policies, Type.t()}],
          colours: Colours.reader(),
          map: Robot.File.Map.reader()
        }

  @doc "The names that a robot can have by default: `mag1` to `mag100`, `min1` to `min100`."
  @spec fleet() :: [atom(), ...]
  def fleet, do: @fleet

  @doc "The whole table."
  @spec table(context()) :: {:keys, Hal.Options.table()}
  def table(context) do
    {:keys,
     id: [{:check, &id(&1, context.fleet), robots(context.fleet)}, required: true],
     profile: [{:one_of, [:magellan, :atrv_mini]}, required: true],
     body: body(),
     drive: [Device.type(:drive), required: true],
     ptz: {:or, nil, Device.type(:ptz)},
     camera: {:or, nil, Device.type(:camera)},
     colours: {:or, nil, Colours.type(context.colours)},
     save_pictures: {:or, nil, {:keys, Vision.Saver.Options.table()}},
     limits: limits(),
     start: pose(@farthest),
     map: {:or, nil, Robot.File.Map.type(context.map)},
     arm: {:one_of, [:manual, :auto]},
     fence: {:or, nil, Fence.type()},
     dry_run: :boolean,
     replace: {:one_of, [false, true]},
     presence: {:or, nil, Robot.Config.presence()},
     estop_file: {:or, nil, {:path, "the path of a file"}},
     console: {:or, nil, {:keys, Keyword.take(PowerSwitch.table(), [:port, :speed, :phrase])}},
     record: {:or, nil, {:keys, RecordOptions.table()}},
     network: extension(:network, context.tables),
     policies: extension(:policies, context.tables)}
  end

  @doc "The option type of `body:`: the parts of the profile that a file may change."
  @spec body() :: Type.t()
  def body do
    {:keys,
     radius: {:number, 0.05, 1.5, "m"},
     length: {:number, 0.1, 2.0, "m"},
     width: {:number, 0.1, 2.0, "m"},
     height: {:number, 0.05, 2.5, "m"},
     wheel_base: {:number, 0.05, 2.0, "m"},
     sonars: {:list, pose(2.0), 64},
     sonar_min: {:number, 0.0, 1.0, "m"},
     sonar_max: {:number, 0.5, 12.0, "m"},
     sonar_cone: {:number, 0.02, 1.6, "rad"},
     irs: {:list, pose(2.0), 32},
     ir_max: {:number, 0.05, 6.0, "m"},
     bumpers: {:integer, 0, 16},
     camera:
       {:keys,
        width: {:integer, 16, 4_096},
        height: {:integer, 16, 4_096},
        field_of_view: {:number, 0.05, 3.0, "rad"},
        mount_height: {:number, 0.0, 3.0, "m"},
        max_pan: {:number, 0.0, 3.15, "rad"},
        max_tilt: {:number, 0.0, 1.58, "rad"},
        pan_rate: {:number, 0.01, 10.0, "rad/s"},
        tilt_rate: {:number, 0.01, 10.0, "rad/s"}}}
  end

  # `Robot.File` compares them with the profile.
  defp limits do
    {:keys,
     max_linear: {:number, 0.01, 10.0, "m/s"},
     max_turn: {:number, 0.01, 10.0, "rad/s"},
     max_acceleration: {:number, 0.01, 10.0, "m/s2"},
     max_turn_acceleration: {:number, 0.01, 10.0, "rad/s2"}}
  end

  # Keys that an app above this one defines.
  defp extension(key, tables),
    do: Keyword.get(tables, key, {:check, &Type.keys?/1, "[key: value, …]"})

  defp id(id, fleet), do: id in fleet

  defp robots(@fleet), do: "a robot of the fleet, :mag1 to :mag100 or :min1 to :min100,"

  defp robots(fleet),
    do: "a robot of the fleet, #{fleet |> Enum.take(10) |> Enum.map_join(", ", &inspect/1)},"

  defp pose(most) do
    {:check, &place(&1, most),
     "{x, y, heading}, metres up to #{most} and radians, such as {1.0, 0.5, deg(90)},"}
  end

  defp place({x, y, heading}, most)
       when is_number(x) and is_number(y) and is_number(heading) and abs(x) <= most and
              abs(y) <= most and abs(heading) <= 100,
       do: {:ok, Pose.new(x, y, heading)}

  defp place(_other, _most), do: false

  @doc "The profile of a kind, with the changes that the file makes to it."
  @spec profile(:magellan | :atrv_mini, keyword()) :: Profile.t()
  def profile(kind, body) do
    {camera, body} = Keyword.pop(body, :camera, [])
    profile = apply(Profile, kind, [])
    struct!(%{profile | camera: Map.merge(profile.camera, Map.new(camera))}, body)
  end
end
