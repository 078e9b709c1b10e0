defmodule Robot.Config do
  @moduledoc """
  Holds the options of one robot, checked once.

    * `:id` - an atom, such as `:mag1`
    * `:profile` - its body, `%Hal.Profile{}`
    * `:drive` - `{driver, options}`, an implementation of `Hal.Drive`
    * `:ptz`, `:camera`, `:scan` - the same for `Hal.Ptz`, `Hal.Camera` and `Hal.Lidar`, or `nil` for none (the default)
    * `:start` - its pose when it is switched on, in the `map` frame; `%Hal.Pose{}`, default the
      origin
    * `:colours` - what the camera looks for, `%Vision.Colours{}`; needed with a camera
    * `:marks` - the printed marks that the camera looks for, options of `Vision.Marks`, or `nil` (the default) for none; and
      `known: [{7, {x, y, heading}}]`, where those with these ids hang and face, in the `map` frame (metres, radians), and
      `robots: [{11, :mag2}]`, which robots bear them on their backs
    * `:save_pictures` - where and how the camera's pictures are saved, options of `Vision.Saver`,
      or `nil` (the default)
    * `:limits` - values that replace those of the profile and may not exceed them, such as
      `[max_linear: 0.3]`: `:max_linear` (m/s), `:max_turn` (rad/s), `:max_acceleration` (m/s2),
      `:max_turn_acceleration` (rad/s2)
    * `:mission` - `{module, options}` that `Robot.Control.Pilot.start/1` starts, or `nil`
    * `:companions` - `[{module, options}]`, each a `Robot.Companion`
    * `:transport` - `{m, f, a}`; messages to other robots go to `apply(m, f, a ++ [from, to, message])`;
      `nil` drops them
    * `:clock` - `{m, f, a}` that returns integer milliseconds, default the monotonic time
    * `:pace` - `:clock`, or `:manual`: gate and executive do not tick by themselves, but when
      they are sent `:step` and `:tick`, so that a test determines the order
    * `:arm` - `:auto` (the default), or `:manual`: the wheels stand until a person arms them
    * `:plan` - the walls of the building, `%Nav.Grid{}` in the `map` frame, an empty
      `Nav.OccupancyGrid` for those that the sonars will have seen, or `nil` (the default) for none
    * `:seed` - that of the random numbers with which the robot looks for its place on a floor plan (`Robot.Localiser.MonteCarlo`),
      with its name; 0 by default
    * `:fence` - a fence that the robot must not cross, `{{x, y}, {x, y}}` or `[{x, y}, …]`, see
      `Robot.Fence`, or `nil`
    * `:dry_run` - whether the robot only prints what it would do (`Robot.Safety.DryRun`), default
      `false`
    * `:say` - what of the robot is said aloud (`Robot.Devices.Speech`), or `nil` (the default) for nothing
    * `:presence` - so many seconds after a person was last heard (`Robot.Safety.Gate.present/2`) the robot stops, and is held as by an
      emergency stop; `nil` (the default): it needs no person
    * `:replace` - whether its mission may be replaced while it runs (`Swarm.replace/2`), default `false`
    * `:estop_file` - a file in which the e-stop latch survives a restart of the machine, or `nil`
    * `:departure_file` - a file that remembers that the robot has left its start pose (`Robot.Departure`), or `nil`
    * `:trace` - `{m, f, a}` that gets all inputs and effects, see `Robot.Trace`, or `nil`

  `boot` is no option: `Robot.Host` sets it to the time of day at which a role starts (ns), which tells its lives apart,
  unless a test has set it.
  """
  alias Hal.{Options, Pose, Profile}
  alias Robot.Fence

  @limits for key <- [:max_linear, :max_turn, :max_acceleration, :max_turn_acceleration],
              do: {key, {:number, 1.0e-6, 100.0}}

  # Ranges that are older do not count (`Hal.RFlex.Sensors.Sonar`).
  @longest_round_s 2.0

  @enforce_keys [:id, :profile, :drive]
  defstruct @enforce_keys ++
              [
                ptz: nil,
                camera: nil,
                scan: nil,
                start: Pose.new(0, 0),
                colours: nil,
                marks: nil,
                save_pictures: nil,
                limits: [],
                mission: nil,
                companions: [],
                transport: nil,
                clock: {System, :monotonic_time, [:millisecond]},
                pace: :clock,
                arm: :auto,
                plan: nil,
                seed: 0,
                fence: nil,
                dry_run: false,
                replace: false,
                say: nil,
                presence: nil,
                estop_file: nil,
                departure_file: nil,
                trace: nil,
                boot: nil
              ]

  @type module_options :: {module(), keyword()}
  @type call :: {module(), atom(), list()}

  @type t :: %__MODULE__{
          id: atom(),
          profile: Profile.t(),
          drive: module_options(),
          ptz: module_options() | nil,
          camera: module_options() | nil,
          scan: module_options() | nil,
          start: Pose.t(),
          colours: struct() | nil,
          marks: keyword() | nil,
          save_pictures: keyword() | nil,
          limits: keyword(),
          mission: module_options() | nil,
          companions: [module_options()],
          transport: call() | nil,
          clock: call(),
          pace: :clock | :manual,
          arm: :auto | :manual,
          plan: Nav.Grid.t() | Nav.OccupancyGrid.t() | nil,
          seed: non_neg_integer(),
          fence: Fence.t() | nil,
          dry_run: boolean(),
          replace: boolean(),
          say: keyword() | nil,
          presence: float() | nil,
          estop_file: Path.t() | nil,
          departure_file: Path.t() | nil,
          trace: call() | nil,
          boot: integer() | nil
        }

  @doc """
  Checks options and builds a config; an error is one line.

      iex> {:ok, config} =
      ...>   Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan(), drive: {Some.Drive, []})
      iex> config.start
      Hal.Pose.new(0, 0)
      iex> Robot.Config.new(id: "mag1", profile: Hal.Profile.magellan(), drive: {Some.Drive, []})
      {:error, "robot option id: expected an atom such as :mag1, got \\"mag1\\""}
      iex> {:ok, config} = Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan(),
      ...>   drive: {Some.Drive, []}, limits: [max_linear: 0.3])
      iex> config.profile.max_linear
      0.3
      iex> Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan(), drive: {Some.Drive, []}, arm: :hand)
      {:error, "robot option arm: expected :auto or :manual, got :hand"}
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, line :: String.t()}
  def new(options) do
    with {:ok, options} <- Options.check(options, table(), "robot"),
         do: check(struct!(__MODULE__, options))
  end

  @doc "The same, but raises `ArgumentError` with that line."
  @spec new!(keyword()) :: t()
  def new!(options) do
    case new(options) do
      {:ok, config} -> config
      {:error, line} -> raise ArgumentError, line
    end
  end

  @doc "The time by this robot's clock, in milliseconds."
  @spec now(t()) :: integer()
  def now(%__MODULE__{clock: {m, f, a}}), do: apply(m, f, a)

  @doc "A ticker for a part of this robot; `nil` with `pace: :manual`."
  @spec ticker(t(), message :: term(), period_ms :: pos_integer()) :: Hal.Ticker.t() | nil
  def ticker(%__MODULE__{pace: :manual}, _message, _period_ms), do: nil

  def ticker(%__MODULE__{pace: :clock}, message, period_ms),
    do: Hal.Ticker.start(message, period_ms, period_ms)

  defp table do
    [
      id: [{:check, &id?/1, "an atom such as :mag1"}, required: true],
      profile: [{:struct, Profile}, required: true],
      drive: [:driver, required: true],
      ptz: [:driver, default: nil],
      camera: [:driver, default: nil],
      scan: [:driver, default: nil],
      start: {:struct, Pose},
      colours: [{:struct, Vision.Colours}, default: nil],
      marks: [marks(), default: nil],
      save_pictures: [{:keys, Vision.Saver.Options.table()}, default: nil],
      limits: {:keys, @limits},
      mission: [:driver, default: nil],
      companions: {:list, :driver},
      transport: [:mfa, default: nil],
      clock: :mfa,
      pace: {:one_of, [:clock, :manual]},
      arm: {:one_of, [:auto, :manual]},
      plan: [{:check, &plan?/1, "walls"}, default: nil],
      seed: {:integer, 0, 4_294_967_295},
      fence: [Fence.type(), default: nil],
      dry_run: :boolean,
      replace: {:one_of, [false, true]},
      say: [{:keys, Robot.Config.Speech.table()}, default: nil],
      presence: [presence(), default: nil],
      estop_file: [{:path, "the path of a file"}, default: nil],
      departure_file: [{:path, "the path of a file"}, default: nil],
      trace: [:mfa, default: nil]
    ]
  end

  @doc "The option type of `marks`."
  @spec marks() :: Options.Type.t()
  def marks do
    place = {:check, &place?/1, "{x, y, heading}"}
    known = {:list, {:tuple, [{:integer, 0, 65_535}, place], "{id, {x, y, heading}}"}}

    bears =
      {:tuple, [{:integer, 0, 65_535}, {:check, &id?/1, "a robot such as :mag2,"}], "{id, robot}"}

    {:keys, Vision.Marks.table() ++ [known: known, robots: {:list, bears}]}
  end

  # The standard deviation of the place may follow.
  defp place?(place),
    do:
      is_tuple(place) and tuple_size(place) in 3..4 and
        Enum.all?(Tuple.to_list(place), &(is_number(&1) and abs(&1) <= 1.0e6)) and
        (tuple_size(place) == 3 or elem(place, 3) >= 0)

  @doc "The option type of `presence`."
  @spec presence() :: Options.Type.t()
  def presence, do: {:number, 0.5, 60.0, "s"}

  defp plan?(%module{}), do: module in [Nav.Grid, Nav.OccupancyGrid]
  defp plan?(plan), do: plan == nil

  @doc "How long a round of a robot's sonars may take at most, in seconds."
  @spec longest_sonar_round_s() :: float()
  def longest_sonar_round_s, do: @longest_round_s

  defp id?(id), do: is_atom(id) and id not in [nil, true, false]

  defp check(%{camera: nil, save_pictures: [_ | _]}),
    do: {:error, "robot option save_pictures is for a robot with a camera"}

  defp check(%{camera: nil, marks: [_ | _]}),
    do: {:error, "robot option marks is for a robot with a camera"}

  defp check(%{colours: nil, camera: {_driver, _options}}),
    do: {:error, "robot option colours: expected those of the camera, got nil"}

  # A limit may not be higher than what the body can do.
  defp check(%{profile: profile, limits: limits} = config) do
    case Enum.find(limits, fn {name, value} -> value > Map.fetch!(profile, name) end) do
      nil ->
        with_sonars(%{config | profile: struct!(profile, limits)})

      {name, value} ->
        most = Map.fetch!(profile, name)

        {:error,
         "robot option limits.#{name}: expected at most #{most}, which a #{profile.name} can do, got #{value}"}
    end
  end

  defp slower(nil, seconds), do: seconds
  defp slower(%{period: period}, seconds), do: max(period, seconds)

  # Without the callback all sonars fire at once.
  defp with_sonars(%{drive: {driver, options}, profile: profile} = config) do
    if Code.ensure_loaded?(driver) and function_exported?(driver, :sonar_round_s, 1),
      do: round(config, driver.sonar_round_s(Keyword.put_new(options, :profile, profile))),
      else: {:ok, config}
  end

  defp round(config, seconds)
       when is_float(seconds) and seconds >= 0.0 and seconds <= @longest_round_s,
       do:
         {:ok,
          %{
            config
            | profile: %{config.profile | sonar_round_s: slower(config.profile.scan, seconds)}
          }}

  defp round(_config, seconds) do
    {:error,
     "robot option drive: expected 0.0 to #{@longest_round_s} s for a round of its sonars, got #{inspect(seconds)}"}
  end
end
