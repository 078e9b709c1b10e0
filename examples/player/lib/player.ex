defmodule Player do
  @moduledoc """
  Turns a configuration file of the Player device server (1.x, 2 or 3), which the thesis's robots
  used, into a robot file. Pure; `mix robot.import` is its command.

  | Player's driver | becomes | by |
  |---|---|---|
  | `rflex`, or `rflex_position`, `rflex_sonar` and its kin | `drive`, `body`, acceleration in `limits` | `Player.RFlexOptions` |
  | `sonyevid30` | `ptz` | `Player.CameraOptions` |
  | `camerav4l` and its kin | `camera` | |
  | `cmvision` | `colours` | |

  `Player.Defaults` and `Player.Boards` derive what follows from several options, and from
  Player's own defaults.

  Everything else is left out and reported: each option and section with its line and the reason.
  Units are those of `Player.Units`. If a file says something else than it seems to mean, the
  assumption is reported as well.
  """
  alias Player.{
    Boards,
    CameraOptions,
    Defaults,
    Parts,
    Robots,
    RFlexOptions,
    Sections,
    State,
    Units,
    Unsupported
  }

  alias Hal.RobotName
  alias Player.Writer
  alias Robot.File.Bodies

  @drivers %{
    "rflex" => :drive,
    "sonyevid30" => :ptz,
    "camerav4l" => :camera,
    "camerav4l2" => :camera,
    "camerav4lc" => :camera,
    "camerauvc" => :camera,
    "cmvision" => :colours
  }
  @modules %{drive: Hal.RFlex.Driver, ptz: Hal.Visca.Driver, camera: Hal.Camera.FFmpeg}
  @said ~w(name driver provides requires alwayson plugin key)

  @type result :: %{
          text: String.t(),
          id: atom(),
          profile: body :: atom(),
          assumed: [State.remark()],
          left: [State.remark()]
        }

  @doc """
  The robot file for a configuration file's text. Options:

    * `:file` - its name, for errors and the head of the new file
    * `:id` - the robot's name; default that of its body with a 1, such as `mag1`
    * `:profile` - the name of a body (`Robot.File.Bodies`); by default guessed, `:magellan` or `:atrv_mini`
    * `:version` - 1 or 2 (and later) for Player's; by default found out from the names of its
      options
    * `:colours` - `function.(name)` gives `{path, {:ok, colours} | {:error, line}}`: the path of
      the colour file for the robot file, and what is in it

  The error is one line, with the line of the file. It names what keeps the file from being read, or says why there is no robot in
  it (`Player.Unsupported.robotless/1`), or which of its lines leaves open where the robot's sensors are (`Player.Boards.sure/1`).

  A file that has several robots, at ports of their own, is read for the first of them (`Player.Robots`).
  """
  @spec import(String.t(), keyword()) :: {:ok, result()} | {:error, String.t()}
  def import(text, options \\ []) do
    file = Keyword.get(options, :file, "configuration file")

    with {:ok, parsed} <- Sections.parse(text),
         :ok <- based(parsed),
         {sections, left, assumed} = Robots.one(Parts.join(parsed.sections), &kind/1),
         units = Units.context(parsed.options, sections, options[:version]),
         state = start(parsed, left, assumed),
         state = Enum.reduce(sections, state, &section(&1, &2, units)),
         # The fault of a line itself is reported before the faults that follow from it.
         :ok <- Boards.sure(state),
         {profile, state} = finish(state, options),
         :ok <- Boards.sure(state) do
      {:ok, result(state, profile, file, options)}
    else
      {:error, {line, why}} -> {:error, "#{file}:#{line}: #{why}"}
    end
  end

  defp start(parsed, left, assumed) do
    included =
      for {line, name} <- parsed.includes do
        {line, "include \"#{name}\"",
         "other files are not read: import that file, or copy its text"}
      end

    global =
      for {name, line, _value} <- parsed.options, name not in ~w(unit_length unit_angle) do
        {line, name, "says nothing about the robot"}
      end

    %{values: [], assumed: assumed, left: included ++ global ++ left, seen: []}
  end

  # What a section's driver is here, or `nil`.
  defp kind(section) do
    name = Sections.driver(section)
    if name in Parts.names(), do: :drive, else: Map.get(@drivers, name)
  end

  defp section(section, state, units) do
    name = Sections.driver(section)

    case {section.type, kind(section)} do
      {"driver", nil} ->
        left(state, section.line, "driver #{name}", Unsupported.driver(name, names()))

      {type, nil} ->
        left(state, section.line, type, Unsupported.section(type))

      {_type, kind} ->
        first(kind, name, section, state, units)
    end
  end

  # The plain names first: of two that are equally near, these are suggested.
  defp names, do: @drivers |> Map.keys() |> Enum.sort()

  defp left(state, line, what, why), do: %{state | left: [{line, what, why} | state.left]}

  defp first(kind, name, section, state, units) do
    if kind in state.seen do
      left(state, section.line, "driver #{name}", "a robot has one #{kind}; the first is taken")
    else
      state = %{state | seen: [kind | state.seen]}

      inner =
        for inner <- section.sections, do: {inner.line, inner.type, "a driver has no sections"}

      options = Enum.reject(section.options, fn {name, _line, _value} -> name in @said end)

      {options, again} = once(options)
      left = for {name, line, _value} <- again, do: {line, name, "occurs twice; the last counts"}

      Enum.reduce(options, %{state | left: left ++ inner ++ state.left}, fn {name, line, value},
                                                                            state ->
        carry(state, {line, name}, carried(kind, name, value, units, options))
      end)
    end
  end

  # Player writes what comes later over what was there. The remark is at the line of the last, which counts.
  defp once(options) do
    last = options |> Enum.reverse() |> Enum.uniq_by(&elem(&1, 0)) |> Enum.reverse()
    names = Enum.frequencies_by(options, &elem(&1, 0))
    {last, Enum.filter(last, fn {name, _line, _value} -> names[name] > 1 end)}
  end

  defp carried(kind, name, value, units, others) do
    cond do
      is_binary(value) and not plain?(value) -> {:left, "is not plain text"}
      kind == :drive -> RFlexOptions.option(name, value, units, others)
      true -> CameraOptions.option(kind, name, value, units)
    end
  end

  # Characters that change the direction of writing make a file look different from what it is.
  defp plain?(text),
    do: String.printable?(text) and not (text =~ ~r/[\x{202A}-\x{202E}\x{2066}-\x{2069}]/u)

  defp carry(state, _where, :used), do: state

  defp carry(state, {line, name}, {:ok, values}),
    do: State.keep(state, line, name, values)

  defp carry(state, {line, name}, {:assumed, values, why}),
    do: state |> State.keep(line, name, values) |> State.assume(line, name, why)

  defp carry(state, {line, name}, {:left, why}),
    do: left(state, line, name, why)

  defp based(parsed) do
    if Enum.any?(parsed.sections, &(kind(&1) == :drive)),
      do: :ok,
      else: {:error, Unsupported.robotless(parsed)}
  end

  defp finish(state, options) do
    state = Player.Validate.allowed(state, @modules)
    {profile, state} = Defaults.profile(state, options[:profile])
    state = state |> Defaults.complete(profile) |> Boards.complete(profile)
    {profile, coloured(state, options[:colours])}
  end

  defp result(state, profile, file, options) do
    id = options[:id] || hd(RobotName.numbered(Bodies.short(profile), 1))

    %{
      text: write(state, file, id, profile, @modules),
      id: id,
      profile: profile,
      assumed: Enum.sort(state.assumed),
      left: Enum.sort(state.left)
    }
  end

  # Without colours there is nothing for our camera to look for.
  defp coloured(state, read) do
    file = State.value(state, [:colours, :file])

    cond do
      file == nil ->
        blind? = &match?({[kind, _], _, _, _} when kind in [:camera, :colours], &1)
        State.leave(state, blind?, "a camera needs a driver cmvision with a colorfile")

      read == nil ->
        state

      true ->
        looked(state, file, read.(file))
    end
  end

  defp looked(state, file, {path, result}) do
    {at, _, line, option} = List.keyfind(state.values, [:colours, :file], 0)
    state = %{state | values: List.keyreplace(state.values, at, 0, {at, path, line, option})}

    case result do
      {:ok, %{classes: [%{name: first} | _] = classes}} ->
        if Enum.any?(classes, &(&1.name == "YellowLandmark")),
          do: state,
          else:
            state
            |> State.assume(
              line,
              file,
              "its first colour, #{first}, is taken for the landmark's"
            )
            |> State.keep(line, option, [{[:policies, :colour], first}])

      {:error, why} ->
        left(state, line, option, "the colour file must be corrected: #{why}")
    end
  end

  # Writes the text of a robot file from an imported Player configuration. Pure.

  @order [:id, :profile, :body, :drive, :ptz, :camera, :colours, :limits, :start, :policies]

  # The text of the robot file: comments on its source and on what was assumed, then all keys;
  # `modules` are the drivers.
  defp write(state, file, id, profile, modules) do
    nested =
      Enum.reduce(state.values, [], fn {path, value, _, _}, all -> nest(all, path, value) end)

    known = %{id: id, profile: profile, start: {0.0, 0.0, {:deg, 0.0}}}

    keys =
      for key <- @order, value = known[key] || key(key, nested[key], modules), do: {key, value}

    Writer.text(head(file, state), keys)
  end

  defp key(kind, options, modules) when is_map_key(modules, kind),
    do: options && {modules[kind], options}

  defp key(_key, value, _modules), do: value

  defp head(file, state) do
    assumed =
      for {line, what, why} <- Enum.sort(state.assumed), do: "  line #{line}, #{what}: #{why}"

    lines =
      [
        "From #{Path.basename(file)}, a configuration of the Player device server.",
        "mix robot.check shows what it says; template.exs explains all keys."
      ] ++ if(assumed == [], do: [], else: ["", "Assumed:" | assumed])

    # A comment must not contain what would end it.
    Enum.map(lines, &String.replace(&1, ~r/[^\x20-\x7E]/, "?"))
  end

  # In the order of the lines of Player's file.
  defp nest(all, [key], value), do: all ++ [{key, value}]

  defp nest(all, [key | path], value) do
    inner = nest(Keyword.get(all, key, []), path, value)

    if Keyword.has_key?(all, key),
      do: Keyword.replace!(all, key, inner),
      else: all ++ [{key, inner}]
  end
end
