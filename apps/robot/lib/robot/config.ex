defmodule Robot.Config do
  @moduledoc """
  What one robot is started with, checked once.

    * `:id` - an atom, as `:mag1`
    * `:profile` - its body, `%Hal.Profile{}`
    * `:drive` - `{driver, options}`, an implementation of `Hal.Drive`
    * `:ptz`, `:camera` - the same of `Hal.Ptz` and `Hal.Camera`, or `nil` for none (the default)
    * `:start` - where it is switched on, in the `map` frame; `%Hal.Pose{}`, default the origin
    * `:colours` - what the camera looks for, `%Vision.Colours{}`; needed with a camera
    * `:save_pictures` - where and how the camera's pictures are kept, options of `Vision.Saver`; or `nil`,
      the default
    * `:limits` - what to lower in the profile, as `[max_linear: 0.3]`: `:max_linear` (m/s), `:max_turn`
      (rad/s), `:max_acceleration` (m/s2), `:max_turn_acceleration` (rad/s2)
    * `:mission` - `{module, options}` that `Robot.Control.Pilot.start/1` starts, or `nil`
    * `:companions` - `[{module, options}]`, each a `Robot.Companion`
    * `:send` - `{m, f, a}`; what the mission says goes to `apply(m, f, a ++ [to, message])`; or
      `nil`: nobody hears it
    * `:on_latch` - `{m, f, a}`, applied by the gate whenever it has set or cleared its e-stop latch, or `nil`
    * `:clock` - `{m, f, a}` giving integer milliseconds, default the monotonic time
    * `:pace` - `:clock`, or `:manual`: gate and executive act when they are sent `:step` and `:tick`
      and not by themselves, so that a test decides the order of everything
    * `:arm` - `:auto` (the default), or `:manual`: the wheels stand until a person arms them
    * `:fence` - a line that the robot does not cross, `{{x, y}, {x, y}}` or `[{x, y}, …]`, see
      `Robot.Safety.Reflex.Fence`; or `nil`
    * `:dry_run` - whether nothing moves, and what would is printed (`Robot.Safety.DryRun`), default `false`
    * `:estop_file` - where the e-stop latch outlives the machine, or `nil`
    * `:trace` - `{m, f, a}` that is told all that goes in and out, see `Robot.Control.Trace`, or `nil`
  """
  alias Hal.{Pose, Profile}
  alias Robot.Safety.Reflex.Fence

  @limits [:max_linear, :max_turn, :max_acceleration, :max_turn_acceleration]

  @enforce_keys [:id, :profile, :drive]
  defstruct @enforce_keys ++
              [
                ptz: nil,
                camera: nil,
                start: nil,
                colours: nil,
                save_pictures: nil,
                limits: [],
                mission: nil,
                companions: [],
                send: nil,
                on_latch: nil,
                clock: {System, :monotonic_time, [:millisecond]},
                pace: :clock,
                arm: :auto,
                fence: nil,
                dry_run: false,
                estop_file: nil,
                trace: nil
              ]

  @type module_options :: {module(), keyword()}
  @type call :: {module(), atom(), list()}

  @type t :: %__MODULE__{
          id: atom(),
          profile: Profile.t(),
          drive: module_options(),
          ptz: module_options() | nil,
          camera: module_options() | nil,
          start: Pose.t(),
          colours: struct() | nil,
          save_pictures: keyword() | nil,
          limits: keyword(),
          mission: module_options() | nil,
          companions: [module_options()],
          send: call() | nil,
          on_latch: call() | nil,
          clock: call(),
          pace: :clock | :manual,
          arm: :auto | :manual,
          fence: Fence.t() | nil,
          dry_run: boolean(),
          estop_file: Path.t() | nil,
          trace: call() | nil
        }

  @doc """
  A checked config.

      iex> {:ok, config} =
      ...>   Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan(), drive: {Some.Drive, []})
      iex> config.start
      Hal.Pose.new(0, 0)
      iex> Robot.Config.new(id: "mag1", profile: Hal.Profile.magellan(), drive: {Some.Drive, []})
      {:error, "robot option :id cannot be \\"mag1\\": it must be an atom such as :mag1"}
      iex> {:ok, config} = Robot.Config.new(id: :mag1, profile: Hal.Profile.magellan(),
      ...>   drive: {Some.Drive, []}, limits: [max_linear: 0.3])
      iex> config.profile.max_linear
      0.3
      iex> Robot.Config.new(id: :mag1, wheels: 4)
      {:error, "unknown robot option :wheels"}
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, line :: String.t()}
  def new(options) do
    known = %__MODULE__{id: nil, profile: nil, drive: nil, start: Pose.new(0, 0)}

    case Enum.find(options, fn {key, _} -> key == :__struct__ or not is_map_key(known, key) end) do
      nil -> check(struct!(known, options))
      {key, _value} -> {:error, "unknown robot option #{inspect(key)}"}
    end
  end

  @doc "The same, or `ArgumentError` with that line."
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

  @doc "A ticker for a part of this robot; `nil` where it acts when it is sent `message` (`pace: :manual`)."
  @spec ticker(t(), message :: term(), period_ms :: pos_integer()) :: Hal.Ticker.t() | nil
  def ticker(%__MODULE__{pace: :manual}, _message, _period_ms), do: nil

  def ticker(%__MODULE__{pace: :clock}, message, period_ms),
    do: Hal.Ticker.start(message, period_ms, period_ms)

  defp check(config) do
    wrong =
      config
      |> Map.from_struct()
      |> Enum.sort()
      |> Enum.find(fn {option, value} -> not valid?(option, value) end)

    case wrong do
      nil when config.camera != nil and config.colours == nil ->
        {:error, "robot option :colours cannot be nil: a robot with a camera must have colours"}

      nil when config.camera == nil and config.save_pictures != nil ->
        {:error, "robot option :save_pictures is for a robot with a camera"}

      nil ->
        limit(fenced(config))

      {:save_pictures, value} ->
        {:error, line} = Vision.Saver.options(value)
        {:error, "robot option :save_pictures: #{line}"}

      {:fence, value} ->
        {:error, allowed} = Fence.new(value)

        {:error,
         "robot option :fence cannot be #{inspect(value, limit: 10)}: it must be #{allowed}"}

      {option, value} ->
        {:error,
         "robot option #{inspect(option)} cannot be #{inspect(value)}: it must be #{allowed(option)}"}
    end
  end

  defp fenced(%{fence: nil} = config), do: config
  defp fenced(%{fence: %Fence{}} = config), do: config

  defp fenced(config) do
    {:ok, fence} = Fence.new(config.fence)
    %{config | fence: fence}
  end

  # A limit may be lower than what the body can do, never higher.
  defp limit(%{profile: profile, limits: limits} = config) do
    case Enum.find(limits, fn {name, value} -> value > Map.fetch!(profile, name) end) do
      nil ->
        {:ok, %{config | profile: struct!(profile, limits)}}

      {name, value} ->
        {:error,
         "robot option :limits cannot set #{inspect(name)} to #{inspect(value)}: " <>
           "a #{profile.name} can do #{Map.fetch!(profile, name)} at most"}
    end
  end

  defp valid?(:id, id), do: is_atom(id) and id not in [nil, true, false]
  defp valid?(:profile, profile), do: is_struct(profile, Profile)
  defp valid?(:drive, driver), do: module_options?(driver)

  defp valid?(option, value) when option in [:ptz, :camera, :mission],
    do: value == nil or module_options?(value)

  defp valid?(:start, pose), do: is_struct(pose, Pose)
  defp valid?(:colours, colours), do: colours == nil or is_struct(colours, Vision.Colours)

  defp valid?(:save_pictures, options),
    do: options == nil or match?({:ok, _}, Vision.Saver.options(options))

  defp valid?(:limits, list) do
    Keyword.keyword?(list) and
      Enum.all?(list, fn {name, value} -> name in @limits and is_float(value) and value > 0 end)
  end

  defp valid?(:companions, list),
    do: is_list(list) and Enum.all?(list, &module_options?/1)

  defp valid?(:clock, clock), do: call?(clock)
  defp valid?(:pace, pace), do: pace in [:clock, :manual]
  defp valid?(:arm, arm), do: arm in [:auto, :manual]
  defp valid?(:dry_run, dry?), do: is_boolean(dry?)

  defp valid?(:fence, fence),
    do: fence == nil or is_struct(fence, Fence) or match?({:ok, _}, Fence.new(fence))

  defp valid?(option, value) when option in [:send, :on_latch, :trace],
    do: value == nil or call?(value)

  defp valid?(:estop_file, path), do: path == nil or is_binary(path)

  defp allowed(:id), do: "an atom such as :mag1"
  defp allowed(:profile), do: "a %Hal.Profile{}"
  defp allowed(:drive), do: "{driver, options}"
  defp allowed(option) when option in [:ptz, :camera], do: "{driver, options} or nil"
  defp allowed(:mission), do: "{module, options} or nil"
  defp allowed(:start), do: "a %Hal.Pose{}"
  defp allowed(:colours), do: "a %Vision.Colours{} or nil"
  defp allowed(:limits), do: "a keyword list of positive floats for #{Enum.join(@limits, ", ")}"
  defp allowed(:companions), do: "a list of {module, options}"
  defp allowed(:pace), do: ":clock or :manual"
  defp allowed(:arm), do: ":auto or :manual"
  defp allowed(:dry_run), do: "true or false"
  defp allowed(:clock), do: "{module, function, arguments}"

  defp allowed(option) when option in [:send, :on_latch, :trace],
    do: "{module, function, arguments} or nil"

  defp allowed(:estop_file), do: "the path of a file or nil"

  defp module_options?({module, options}), do: is_atom(module) and Keyword.keyword?(options)
  defp module_options?(_other), do: false

  defp call?({m, f, a}), do: is_atom(m) and is_atom(f) and is_list(a)
  defp call?(_other), do: false
end
