defmodule Robot.File.Schema do
  @moduledoc """
  Lists all keys of a robot file and their types, as one table of `Hal.Options`. Pure; `docs/robots.md` and
  `config/robots/template.exs` describe the same keys for people, and tests compare them.
  """
  alias Hal.{Profile, RobotName}
  alias Hal.Options.Type
  alias Hal.RFlex.PowerSwitch
  alias Robot.File.{Body, Colours, Device, RecordOptions}
  alias Robot.File.Terms.Name
  alias Robot.Fence

  @farthest 10_000

  @typedoc "Finds a body by its name; the errors are lines."
  @type bodies :: (atom() | String.t() -> {:ok, Profile.t()} | {:error, [String.t(), ...]})

  @typedoc """
  What the table needs from its caller: functions that find a body, and read a colour file and a map; whether the file
  must name a body, because it has none of its own; and the types of the keys that an app above this one defines.
  """
  @type context :: %{
          bodies: bodies(),
          bodiless?: boolean(),
          tables: [{:network | :policies, Type.t()}],
          colours: Colours.reader(),
          map: Robot.File.Map.reader()
        }

  @doc "The whole table."
  @spec table(context()) :: {:keys, Hal.Options.table()}
  def table(context) do
    {:keys,
     id: [{:check, &id/1, RobotName.allowed() <> ","}, required: true],
     profile: [
       {:check, &body(&1, context.bodies), "the name of a body, such as :magellan,"},
       required: context.bodiless?
     ],
     body: Body.type(),
     drive: [Device.type(:drive), required: true],
     ptz: {:or, nil, Device.type(:ptz)},
     camera: {:or, nil, Device.type(:camera)},
     scan: {:or, nil, Device.type(:scan)},
     colours: {:or, nil, Colours.type(context.colours)},
     marks: {:or, nil, Robot.Config.marks()},
     save_pictures: {:or, nil, {:keys, Vision.Saver.Options.table()}},
     limits: Body.limits(),
     start: Body.pose(@farthest),
     map: {:or, nil, Robot.File.Map.type(context.map)},
     arm: {:one_of, [:manual, :auto]},
     fence: {:or, nil, Fence.type()},
     dry_run: :boolean,
     replace: {:one_of, [false, true]},
     say: {:or, nil, {:keys, Robot.Config.Speech.table()}},
     presence: {:or, nil, Robot.Config.presence()},
     estop_file: {:or, nil, {:path, "the path of a file"}},
     console: {:or, nil, {:keys, Keyword.take(PowerSwitch.table(), [:port, :speed, :phrase])}},
     record: {:or, nil, {:keys, RecordOptions.table()}},
     incidents: {:or, nil, {:keys, RecordOptions.incidents()}},
     network: extension(:network, context.tables),
     policies: extension(:policies, context.tables)}
  end

  # Keys that an app above this one defines.
  defp extension(key, tables),
    do: Keyword.get(tables, key, {:check, &Type.keys?/1, "[key: value, …]"})

  # The file is this machine's configuration, so its name becomes an atom.
  defp id(%Name{text: ":" <> text}), do: with(:error <- RobotName.read(text), do: false)
  defp id(id), do: is_atom(id) and RobotName.valid?(id)

  defp body(%Name{text: ":" <> text}, bodies), do: body(text, bodies)

  defp body(name, bodies)
       when is_binary(name) or (is_atom(name) and name not in [nil, true, false]) do
    with {:error, lines} <- bodies.(name), do: {:error, for(line <- lines, do: {[], line})}
  end

  defp body(_other, _bodies), do: false
end
