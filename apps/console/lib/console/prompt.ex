defmodule Console.Prompt do
  @moduledoc """
  Parses what people type while a fleet runs, against the fleet's names. Pure.

  Names become robots by comparison; a text never becomes an atom.
  """
  alias Console.Fleet
  alias Hal.Cli.Parse
  alias Console.Pace
  alias Console.Prompt.Stop
  alias Hal.Options.Suggest
  alias Robot.Command
  alias Swarm.{BehaviourRegistry, MissionRegistry}

  @object ~r/\A(ball|box)\d{1,4}\z/
  @words ~w(kill formation landmark move place goto follow drive gamepad stop estop reset start run program send replace arm disarm acknowledge keep pause resume step speed status nodes page tell help quit)

  # Linux's name of the first gamepad.
  @gamepad "/dev/input/js0"
  # Far more than any command needs.
  @most_bytes 500

  @type parsed ::
          Console.Live.command()
          | {:drive, atom()}
          | {:gamepad, {atom(), Path.t()} | :off}
          | :help
          | :nodes
          | :page
          | :status
          | {:status, atom()}
          | :quit
          | :nothing

  @doc """
  A command, or one line that says what is allowed.

      iex> Console.Prompt.parse("kill leader", [:mag1])
      {:ok, {:kill, :leader}}
      iex> Console.Prompt.parse("goto mag1 1,2", [:mag1])
      {:ok, {:tell, [:mag1], {:goto, 1.0, 2.0, nil}}}
      iex> Console.Prompt.parse("fromation wedge", [:mag1])
      {:error, ~s(unknown command "fromation"; did you mean formation?)}
      iex> Console.Prompt.parse("step 10", [:mag1])
      {:ok, {:pace, {:step, 10}}}
      iex> Console.Prompt.parse("speed 1000", [:mag1])
      {:error, ~s(speed: expected a number from 0.1 to 100, or max, got "1000")}
  """
  @spec parse(String.t(), [atom()]) :: {:ok, parsed()} | {:error, String.t()}
  def parse(text, _robots) when byte_size(text) > @most_bytes,
    do: {:error, "expected a line of at most #{@most_bytes} bytes"}

  def parse(text, robots) do
    with :other <- stop(text, robots) do
      case String.split(text) do
        [] ->
          {:ok, :nothing}

        [word | rest] ->
          text |> String.downcase() |> key(command(String.downcase(word), rest, robots))
      end
    end
  end

  # On the way of a stop one is generous.
  defp stop(text, robots) do
    if String.valid?(text),
      do: Stop.read(text, @words ++ Enum.map(robots, &to_string/1), robots),
      else: :other
  end

  defp key(text, {:error, line}) do
    if text =~ ~r/stop|halt|emerg|disarm/,
      do: {:error, line <> "; F8 and estop stop all robots"},
      else: {:error, line}
  end

  defp key(_text, parsed), do: parsed

  @doc """
  What a parsed line is: a `:stop`, which goes past all others, an `:order` to the fleet, or something for the view itself.

      iex> for line <- ["estop", "stop mag1", "disarm", "start", "help", "status"] do
      ...>   {:ok, parsed} = Console.Prompt.parse(line, [:mag1])
      ...>   Console.Prompt.kind(parsed)
      ...> end
      [:stop, :stop, :stop, :order, :view, :view]
  """
  @spec kind(parsed()) :: :stop | :order | :view
  def kind(:estop), do: :stop
  def kind({:tell, _target, command}) when command in [:stop, :disarm], do: :stop
  def kind({view, _what}) when view in [:drive, :gamepad, :status], do: :view
  def kind(view) when view in [:help, :nodes, :page, :status, :quit, :nothing], do: :view
  def kind(_command), do: :order

  @doc """
  How an answer begins: the line as it was typed, and what it was taken for, if that is not what stands there.

      iex> Console.Prompt.said("estop now!", :estop)
      "estop now! (estop)"
      iex> Console.Prompt.said(" goto mag1 1,2 ", {:tell, [:mag1], {:goto, 1.0, 2.0, nil}})
      "goto mag1 1,2"
  """
  @spec said(String.t(), parsed()) :: String.t()
  def said(line, parsed) do
    line = String.trim(line)
    meant = meant(parsed)
    if meant == nil or String.downcase(line) in meant, do: line, else: "#{line} (#{hd(meant)})"
  end

  defp meant(:estop), do: ["estop"]

  defp meant({:tell, :all, stop}) when stop in [:stop, :disarm],
    do: ["#{stop} all", "#{stop}", "all #{stop}"]

  defp meant({:tell, robots, stop}) when stop in [:stop, :disarm] do
    names = Enum.join(robots, " ")
    ["#{stop} #{names}", "#{names} #{stop}"]
  end

  defp meant(_other), do: nil

  @doc "The longest line that is read, in bytes."
  @spec most_bytes() :: pos_integer()
  def most_bytes, do: @most_bytes

  @doc """
  The words that may follow the given words.

      iex> Console.Prompt.completions(["kill"], [:mag1])
      ["leader", "mag1"]
      iex> Console.Prompt.completions(["goto", "mag1"], [:mag1])
      []
  """
  @spec completions([String.t()], [atom()]) :: [String.t()]
  def completions(before, robots) do
    names = Enum.map(robots, &to_string/1)

    case before do
      [] -> @words ++ ["all" | names]
      ["kill"] -> ["leader" | names]
      ["formation"] -> Console.Fleet.formations()
      ["landmark"] -> ["none"]
      ["follow", _follower] -> names
      ["tell"] -> ["all" | names]
      ["speed"] -> ["0.1", "1", "10", "max"]
      [word] when word in ["arm", "disarm", "acknowledge", "keep"] -> ["all" | names]
      ["start"] -> MissionRegistry.names() ++ names
      ["start", name] -> if name in names, do: MissionRegistry.names(), else: []
      ["run"] -> names
      ["send"] -> ["all" | names]
      ["run", name] -> if name in names, do: BehaviourRegistry.names(), else: []
      ["program"] -> names
      ["program", _name] -> ["start", "end"]
      ["replace"] -> MissionRegistry.names() ++ ["all" | names]
      ["replace", name] -> if name in ["all" | names], do: MissionRegistry.names(), else: []
      ["gamepad"] -> ["off" | names]
      [word] when word in ["place", "goto", "follow", "drive", "stop", "status"] -> names
      _other -> []
    end
  end

  @doc "The help, one command a line; of what only some fleets can do, what this one offers."
  @spec help([Console.Live.offer()]) :: [String.t()]
  defdelegate help(offers \\ [:kill, :landmark, :place]), to: Console.Prompt.Help, as: :lines

  defp command("kill", ["leader"], _robots), do: {:ok, {:kill, :leader}}
  defp command("kill", [name], robots), do: with_robot(name, robots, &{:kill, &1})

  defp command("kill", _rest, _robots),
    do: {:error, "kill needs one name: kill leader, kill mag1"}

  defp command("formation", [kind], _robots) do
    case Console.Fleet.formation(kind) do
      {:ok, {kind_atom, spacing}} ->
        {:ok, {:formation, {kind_atom, if(kind =~ ":", do: spacing)}}}

      {:error, allowed} ->
        Hal.Cli.Arguments.refuse("formation", kind, allowed)
    end
  end

  defp command("formation", [kind, spacing], robots),
    do: command("formation", [kind <> ":" <> spacing], robots)

  defp command("formation", _rest, _robots),
    do: {:error, "formation needs a kind: #{Parse.either(Console.Fleet.formations())}"}

  defp command(word, ["none"], _robots) when word in ["landmark", "move"],
    do: {:ok, {:landmark, :none}}

  defp command(word, rest, _robots) when word in ["landmark", "move"],
    do: with_point(rest, word <> " X,Y", &{:landmark, &1})

  # Whether there is an object of this name, the fleet knows.
  defp command("place", [name | rest], robots) when rest != [] do
    with {:ok, who} <- if(name =~ @object, do: {:ok, name}, else: robot(name, robots)),
         do: with_point(rest, "place NAME X,Y", &{:place, who, &1})
  end

  defp command("place", _rest, _robots),
    do: {:error, "place needs a name and a place: place mag1 1,2, place ball1 1,2"}

  defp command("goto", [name | rest], robots) when rest != [] do
    with {:ok, robot} <- robot(name, robots) do
      with_point(rest, "goto NAME X,Y", fn {x, y} -> {:tell, [robot], {:goto, x, y, nil}} end)
    end
  end

  defp command("goto", _rest, _robots),
    do: {:error, "goto needs a name and a place: goto mag1 1,2"}

  defp command("follow", [follower, leader], robots) do
    with {:ok, follower} <- robot(follower, robots),
         {:ok, leader} <- robot(leader, robots) do
      if follower == leader,
        do: {:error, "a robot cannot follow itself"},
        else: {:ok, {:tell, [follower], {:follow_the_leader, leader}}}
    end
  end

  defp command("follow", _rest, _robots), do: {:error, "follow needs two names: follow min1 mag1"}

  defp command("drive", [name], robots), do: with_robot(name, robots, &{:drive, &1})
  defp command("drive", _rest, _robots), do: {:error, "drive needs one name: drive mag1"}
  defp command("gamepad", ["off"], _robots), do: {:ok, {:gamepad, :off}}
  defp command("gamepad", [name], robots), do: command("gamepad", [name, @gamepad], robots)

  defp command("gamepad", [name, path], robots),
    do: with_robot(name, robots, &{:gamepad, {&1, path}})

  defp command("gamepad", _rest, _robots),
    do: {:error, "gamepad needs one name, or off: gamepad mag1, gamepad mag1 /dev/input/js1"}

  defp command("start", [], _robots), do: {:ok, {:tell, :all, :start}}
  defp command("start", ["all"], _robots), do: {:ok, {:tell, :all, :start}}

  defp command("start", [mission | rest], robots) when length(rest) < 2 do
    if mission in ["all" | Enum.map(robots, &to_string/1)],
      do: mission_of(mission, rest, robots),
      else: mission_of("all", [mission | rest], robots)
  end

  defp command("run", [name, behaviour], robots) do
    with {:ok, _run} <- MissionRegistry.Text.request({:run, behaviour}, nil),
         do: tell(name, ["run", behaviour], robots)
  end

  defp command("run", _rest, _robots),
    do: {:error, "run needs a name and a behaviour: run mag1 #{behaviour()}"}

  defp command("program", [name, what, program], robots) when what in ["start", "end"],
    do:
      with_robot(
        name,
        robots,
        &{:program, &1, if(what == "end", do: :end, else: :start), program}
      )

  defp command("program", _rest, _robots),
    do: {:error, "program needs a name, start or end, and a program: program mag1 start battery"}

  defp command("send", [name | [_ | _] = message], robots),
    do: tell(name, ["send", Enum.join(message, " ")], robots)

  defp command("send", _rest, _robots),
    do: {:error, "send needs a name, or all, and a message: send mag1 KIND:FIELD=VALUE"}

  defp command("replace", [mission], robots), do: replace("all", mission, robots)
  defp command("replace", [who, mission], robots), do: replace(who, mission, robots)

  defp command("replace", _rest, _robots),
    do: {:error, "replace needs a mission: replace flock, replace mag1 patrol:period=90"}

  defp command("stop", [name], robots), do: with_robot(name, robots, &{:tell, [&1], :stop})

  defp command(word, [name], robots) when word in ["arm", "disarm", "acknowledge"],
    do: tell(name, [word], robots)

  defp command(word, _rest, _robots) when word in ["arm", "disarm", "acknowledge"],
    do: {:error, "#{word} needs one name, or all: #{word} mag1, #{word} all"}

  defp command("keep", [], robots), do: tell("all", ["keep"], robots)
  defp command("keep", [name], robots), do: tell(name, ["keep"], robots)
  defp command("reset", [], _robots), do: {:ok, :reset}

  defp command(word, [], _robots) when word in ["pause", "resume"],
    do: {:ok, {:pace, if(word == "pause", do: :pause, else: :resume)}}

  defp command("step", [], _robots), do: {:ok, {:pace, {:step, 1}}}
  defp command("step", [count], _robots), do: paced("step", :step, count, &Pace.steps/1)
  defp command("speed", [speed], _robots), do: paced("speed", :speed, speed, &Pace.speed/1)

  defp command("speed", _rest, _robots),
    do: {:error, "speed needs one value: speed 0.5, speed max"}

  defp command("status", [], _robots), do: {:ok, :status}
  defp command("nodes", [], _robots), do: {:ok, :nodes}
  defp command("page", [], _robots), do: {:ok, :page}
  defp command("status", [name], robots), do: with_robot(name, robots, &{:status, &1})
  defp command(word, _rest, _robots) when word in ["help", "?"], do: {:ok, :help}
  defp command(word, _rest, _robots) when word in ["quit", "exit", "q"], do: {:ok, :quit}
  defp command("tell", [name | text], robots) when text != [], do: tell(name, text, robots)

  defp command(word, rest, robots) do
    cond do
      String.contains?(word, ":") and rest == [] -> tell("all", [word], robots)
      word in ["all" | Enum.map(robots, &to_string/1)] and rest != [] -> tell(word, rest, robots)
      word in @words -> {:error, "#{word} is used in another way; see help"}
      true -> unknown(word, robots)
    end
  end

  defp paced(word, kind, text, parse) do
    case parse.(text) do
      {:ok, value} -> {:ok, {:pace, {kind, value}}}
      {:error, allowed} -> Hal.Cli.Arguments.refuse(word, text, allowed)
    end
  end

  # start mag2, start patrol, start patrol:period=90, start mag2 patrol
  defp mission_of(who, [], robots), do: tell(who, ["start"], robots)

  defp mission_of(who, [mission], robots) do
    case MissionRegistry.Text.read(mission, length(robots)) do
      {:ok, _mission} -> tell(who, ["start", mission], robots)
      {:error, line} -> {:error, line <> or_robot(mission, robots)}
    end
  end

  defp mission_of(_all, [name, mission], robots) do
    with {:ok, _robot} <- robot(name, robots), do: mission_of(name, [mission], robots)
  end

  defp replace(who, mission, robots) do
    with {:ok, _mission} <- MissionRegistry.Text.read(mission, length(robots)),
         do: tell(who, ["replace", mission], robots)
  end

  defp behaviour, do: List.first(BehaviourRegistry.names()) || "BEHAVIOUR"

  defp or_robot(word, robots), do: Suggest.hint(word, Enum.map(robots, &to_string/1))

  defp tell("all", text, robots), do: checked(:all, Enum.join(text, ":"), robots)

  defp tell(name, text, robots) do
    with {:ok, robot} <- robot(name, robots), do: checked([robot], Enum.join(text, ":"), robots)
  end

  defp checked(target, "replace:" <> mission, _robots),
    do: {:ok, {:tell, target, {:replace, mission}}}

  defp checked(target, text, robots) do
    with {:ok, command} <- Command.parse(text, robots),
         do: {:ok, {:tell, target, command}}
  end

  defp unknown(word, robots) do
    known = @words ++ ["all"] ++ Enum.map(robots, &to_string/1)

    case Suggest.hint(word, known) do
      "" -> {:error, "unknown command #{inspect(word)}; help lists all commands"}
      hint -> {:error, "unknown command #{inspect(word)}#{hint}"}
    end
  end

  defp with_robot(name, robots, build) do
    with {:ok, robot} <- robot(name, robots), do: {:ok, build.(robot)}
  end

  defp robot(name, robots) do
    case Enum.find(robots, &(Atom.to_string(&1) == name)) do
      nil ->
        hint = Suggest.hint(name, Enum.map(robots, &to_string/1))
        {:error, "no robot #{inspect(name)}; there are #{Fleet.describe(robots)}#{hint}"}

      robot ->
        {:ok, robot}
    end
  end

  # "3,2", "3, 2" and "3 2" are all valid places.
  defp with_point(words, form, build) do
    text = words |> Enum.map(&String.trim(&1, ",")) |> Enum.join(",")

    case Parse.point(text) do
      {:ok, point} -> {:ok, build.(point)}
      {:error, allowed} -> {:error, "#{form}: expected a place, #{allowed}"}
    end
  end
end
