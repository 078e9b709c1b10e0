defmodule Robot.File.Schema do
  @moduledoc """
  All that a robot file may say, as one table of `Robot.File.Check`. Pure; `docs/robots.md` and
  `config/robots/template.exs` tell the same to people, and tests compare them.
  """
  alias Hal.Profile
  alias Robot.File.{Check, Colours, Device}
  alias Robot.Safety.Reflex.Fence

  @formations [:column, :line, :wedge, :triangle, :diamond, :circle]
  @fleet for kind <- ~w(mag min), n <- 1..100, do: :"#{kind}#{n}"

  @typedoc "What the world has to say: names of the fleet, and how a colour file is read."
  @type context :: %{
          fleet: [atom(), ...],
          colours: (Path.t(), keyword() -> {:ok, struct()} | {:error, String.t()})
        }

  @doc "The names that a robot can have unless told otherwise: `mag1` to `mag100`, `min1` to `min100`."
  @spec fleet() :: [atom(), ...]
  def fleet, do: @fleet

  @doc "The keys without which there is no robot."
  @spec needed() :: [atom(), ...]
  def needed, do: [:id, :profile, :drive]

  @doc "The whole table."
  @spec table(context()) :: {:keys, [{atom(), Check.check()}]}
  def table(context) do
    {:keys,
     id: {:with, &id(&1, &2, context.fleet)},
     profile: {:one_of, [:magellan, :atrv_mini]},
     body: body(),
     drive: {:with, &Device.check(:drive, &1, &2)},
     ptz: {:or, nil, {:with, &Device.check(:ptz, &1, &2)}},
     camera: {:or, nil, {:with, &Device.check(:camera, &1, &2)}},
     colours: {:or, nil, {:with, &Colours.check(&1, &2, context.colours)}},
     save_pictures: {:or, nil, save_pictures()},
     limits: limits(),
     start: :pose,
     arm: {:one_of, [:manual, :auto]},
     fence: {:or, nil, {:with, &fence/2}},
     dry_run: :boolean,
     estop_file: {:or, nil, {:text, "the path of a file"}},
     console: {:or, nil, {:with, &console/2}},
     network: network(),
     policies: policies()}
  end

  @doc "What of the profile a file may change."
  @spec body() :: Check.check()
  def body do
    {:keys,
     radius: {:number, 0.05, 1.5, "m"},
     length: {:number, 0.1, 2.0, "m"},
     width: {:number, 0.1, 2.0, "m"},
     height: {:number, 0.05, 2.5, "m"},
     wheel_base: {:number, 0.05, 2.0, "m"},
     sonars: {:list, {:with, &mount/2}, 64},
     sonar_min: {:number, 0.0, 1.0, "m"},
     sonar_max: {:number, 0.5, 12.0, "m"},
     sonar_cone: {:number, 0.02, 1.6, "rad"},
     irs: {:list, {:with, &mount/2}, 32},
     ir_max: {:number, 0.05, 6.0, "m"},
     bumpers: {:whole, 0, 16},
     camera:
       {:keys,
        width: {:whole, 16, 4_096},
        height: {:whole, 16, 4_096},
        field_of_view: {:number, 0.05, 3.0, "rad"},
        mount_height: {:number, 0.0, 3.0, "m"},
        max_pan: {:number, 0.0, 3.15, "rad"},
        max_tilt: {:number, 0.0, 1.58, "rad"},
        pan_rate: {:number, 0.01, 10.0, "rad/s"},
        tilt_rate: {:number, 0.01, 10.0, "rad/s"}}}
  end

  defp save_pictures do
    {:keys,
     folder: {:text, "the path of a folder"},
     rate: {:number, 0.001, 30.0, "pictures a second"},
     files: {:whole, 1, 100_000},
     megabytes: {:whole, 1, 1_000_000}}
  end

  # That they are not above what the body can do is checked with the profile.
  defp limits do
    {:keys,
     max_linear: {:number, 0.01, 10.0, "m/s"},
     max_turn: {:number, 0.01, 10.0, "rad/s"},
     max_acceleration: {:number, 0.01, 10.0, "m/s2"},
     max_turn_acceleration: {:number, 0.01, 10.0, "rad/s2"}}
  end

  defp network do
    group = {:with, &group/2}

    {:keys,
     secret_file: {:text, "the path of the fleet's secret"},
     interface: {:with, &address/2},
     port: {:whole, 0, 65_535},
     multicast: {:or, false, group},
     peers: {:list, {:with, &peer/2}, 1_000},
     dist_port: {:whole, 0, 65_535},
     full_mesh: {:whole, 2, 1_000},
     degree: {:whole, 2, 30}}
  end

  # The driver's own check has the last word.
  defp console({line, _value} = node, path) do
    keys =
      {:keys,
       port: {:text, "the path of the machine's serial console"},
       speed: {:whole, 1, 20_000_000},
       phrase: {:text, "the words at which the controller cuts the power"}}

    with {:ok, options} <- Check.run(keys, node, path) do
      case Hal.RFlex.PowerSwitch.options(options) do
        {:ok, _all} -> {:ok, options}
        {:error, text} -> {:error, [{line, path, text}]}
      end
    end
  end

  defp policies do
    {:keys,
     mission: {:or, nil, {:one_of, [:landmark]}},
     formation: {:with, &formation/2},
     assign: {:one_of, [:chain, :cost]},
     leader_change: :boolean,
     colour: {:text, "the name of a colour"},
     policy: {:one_of, [:available, :majority]},
     of: {:whole, 1, 1_000},
     lost_link: {:one_of, [:stop, :hold, :continue]}}
  end

  defp id({_line, {:name, name}} = node, path, fleet) do
    case Enum.find(fleet, &(Atom.to_string(&1) == name)) do
      nil -> Check.refuse("a robot of the fleet is allowed: #{some(fleet)}", node, path)
      id -> {:ok, id}
    end
  end

  defp id(node, path, fleet),
    do: Check.refuse("a name is allowed, such as :#{hd(fleet)}", node, path)

  defp some(fleet) when fleet == @fleet, do: ":mag1 to :mag100 and :min1 to :min100"
  defp some(fleet), do: fleet |> Enum.take(10) |> Enum.map_join(", ", &inspect/1)

  defp fence({_line, shape} = node, path) do
    with {:ok, corners} <- corners(shape), {:ok, fence} <- Fence.new(corners) do
      {:ok, fence}
    else
      {:error, allowed} -> Check.refuse("#{allowed} is allowed", node, path)
    end
  end

  defp corners({:tuple, [{_, one}, {_, other}]}), do: {:ok, {corner(one), corner(other)}}
  defp corners({:list, nodes}), do: {:ok, Enum.map(nodes, fn {_, node} -> corner(node) end)}
  defp corners(other), do: {:ok, other}

  defp corner({:tuple, [{_, x}, {_, y}]}), do: {x, y}
  defp corner(other), do: other

  # A sensor farther from the middle than any body is long is a slip of units.
  defp mount(node, path) do
    case Check.run(:pose, node, path) do
      {:ok, %{x: x, y: y} = pose} when abs(x) <= 2.0 and abs(y) <= 2.0 ->
        {:ok, pose}

      {:ok, _too_far} ->
        Check.refuse("a sensor is at most 2 m from the middle of its robot", node, path)

      error ->
        error
    end
  end

  defp address({_line, text} = node, path) do
    case is_binary(text) and :inet.parse_ipv4strict_address(to_charlist(text)) do
      {:ok, ip} -> {:ok, ip}
      _no -> Check.refuse(~s(an IPv4 address is allowed, such as "10.0.0.7"), node, path)
    end
  end

  defp group({_line, {:tuple, [ip, {_, port}]}} = node, path) when port in 1..65_535 do
    case address(ip, path) do
      {:ok, ip} -> {:ok, {ip, port}}
      _no -> group(put_elem(node, 1, "…"), path)
    end
  end

  defp group(node, path),
    do: Check.refuse(~s(false, or {"239.255.67.86", 4371} is allowed), node, path)

  defp peer({_line, text} = node, path) do
    with true <- is_binary(text),
         [ip, port] <- String.split(text, ":"),
         {:ok, _ip} <- :inet.parse_ipv4strict_address(to_charlist(ip)),
         {port, ""} when port in 1..65_535 <- Integer.parse(port) do
      {:ok, text}
    else
      _no -> Check.refuse(~s(address and port are allowed, such as "10.0.0.7:4370"), node, path)
    end
  end

  defp formation({_line, {:tuple, [kind, spacing]}}, path) do
    with {:ok, [kind, spacing]} <-
           Check.all([
             Check.run({:one_of, @formations}, kind, path),
             Check.run({:number, 0.8, 5.0, "m"}, spacing, path)
           ]),
         do: {:ok, {kind, spacing}}
  end

  defp formation(node, path),
    do:
      Check.refuse(
        "a kind and a spacing in metres are allowed, such as {:column, 1.0}",
        node,
        path
      )

  @doc "The profile of a kind with what the file changes of it."
  @spec profile(:magellan | :atrv_mini, keyword()) :: Profile.t()
  def profile(kind, body) do
    {camera, body} = Keyword.pop(body, :camera, [])
    profile = apply(Profile, kind, [])
    struct!(%{profile | camera: Map.merge(profile.camera, Map.new(camera))}, body)
  end
end
