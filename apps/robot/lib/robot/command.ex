defmodule Robot.Command do
  @moduledoc """
  Parses text commands from a person to a robot, in the colon notation of the thesis: a case-insensitive
  keyword and its arguments. Pure; parsing never creates atoms from its input and does not raise.

  | text | command |
  |---|---|
  | `stop` | `:stop` |
  | `move:V:W` or `move:V:W:S` | `{:move, v, w}`, m/s and rad/s; `{:move, v, w, s}` for that many seconds only |
  | `goto:X:Y` or `goto:X:Y:THETA` | `{:goto, x, y, theta or nil}`, metres, radians |
  | `followtheleader:NAME` | `{:follow_the_leader, id}` |
  | `findblob` or `findblob:COLOUR` | `{:find_blob, colour or nil}` |
  | `subscribe:NAME`, `unsubscribe:NAME` | `{:subscribe, id}`, `{:unsubscribe, id}`; see below |
  | `position:X:Y:THETA`, `follow:X:Y:THETA` | `{:position, pose}`, `{:follow, pose}` |
  | `blob:X:Y:THETA:SIZE:FOUND` | `{:blob, pose, size, found?}`; FOUND is 0 or 1 |
  | `look:PAN` | `{:look, pan}`, where the camera looks from now on, radians, left positive |
  | `wander`, `rest`, `square` or `square:SIDE` | `:wander`, `:rest`, `{:square, metres or nil}` (`Robot.Behaviour`) |
  | `run:BEHAVIOUR` or `run:BEHAVIOUR:OPTIONS` | `{:run, text}`, a behaviour that the build has named, and its options in words (`Swarm.BehaviourRegistry`) |
  | `send:KIND` or `send:KIND:FIELDS` | `{:send, text}`, a message to the running mission, of a kind that it hears from people, and its fields in words (`Swarm.MissionRegistry.Text`) |
  | `lead`, `start`, `ping`, `keep` | `:lead`, `:start`, `:ping`, `:keep` |
  | `start:MISSION` or `start:MISSION:OPTIONS` | `{:start, text}`, a mission and its options in words (`Swarm.MissionRegistry.Text`) |
  | `arm`, `disarm`, `acknowledge` | `:arm`, `:disarm`, `:acknowledge` (`Hal.Device.Arming`) |

  Robots refuse subscriptions, because all robots report their poses to all others anyway.
  """
  alias Hal.Pose
  alias Hal.Options.Suggest
  alias Robot.Command

  @type t ::
          :stop
          | :lead
          | :start
          | {:start, mission :: String.t()}
          | {:run, behaviour :: String.t()}
          | {:run, module(), options :: keyword()}
          | {:send, message :: String.t()}
          | :wander
          | :rest
          | {:square, side :: float() | nil}
          | :ping
          | :keep
          | :arm
          | :disarm
          | :acknowledge
          | {:look, float()}
          | {:move, float(), float()}
          | {:move, float(), float(), for_s :: float()}
          | {:goto, float(), float(), float() | nil}
          | {:follow_the_leader, atom()}
          | {:find_blob, String.t() | nil}
          | {:subscribe, atom()}
          | {:unsubscribe, atom()}
          | {:position, Pose.t()}
          | {:follow, Pose.t()}
          | {:blob, Pose.t(), float(), boolean()}

  # Keyword, required arguments, optional arguments.
  @grammar [
    {"stop", [], []},
    {"move", [:v, :w], [:seconds]},
    {"goto", [:x, :y], [:theta]},
    {"followtheleader", [:name], []},
    {"findblob", [], [:colour]},
    {"subscribe", [:name], []},
    {"unsubscribe", [:name], []},
    {"position", [:x, :y, :theta], []},
    {"blob", [:x, :y, :theta, :size, :found], []},
    {"follow", [:x, :y, :theta], []},
    {"look", [:pan], []},
    {"lead", [], []},
    {"wander", [], []},
    {"rest", [], []},
    {"square", [], [:side]},
    {"run", [:behaviour], [:options]},
    {"send", [:kind], [:fields]},
    {"start", [], [:mission, :options]},
    {"ping", [], []},
    {"keep", [], []},
    {"arm", [], []},
    {"disarm", [], []},
    {"acknowledge", [], []}
  ]

  @keywords Enum.map(@grammar, &elem(&1, 0))
  # No valid command is longer.
  @longest 500

  @doc "All keywords."
  @spec keywords() :: [String.t(), ...]
  def keywords, do: @keywords

  @doc """
  The command of a text, or one line that says what is wrong with it and what is allowed. `known`
  are the names that robots may have.

      iex> Robot.Command.parse("GoTo:2.0:-1", [:mag1])
      {:ok, {:goto, 2.0, -1.0, nil}}
      iex> Robot.Command.parse("move:0.5:0:0.3", [])
      {:ok, {:move, 0.5, 0.0, 0.3}}
      iex> Robot.Command.parse("start:patrol:period=90", [])
      {:ok, {:start, "patrol:period=90"}}
      iex> Robot.Command.parse("followtheleader:mag1", [:mag1, :min1])
      {:ok, {:follow_the_leader, :mag1}}
      iex> Robot.Command.parse("goto:abc:1", [])
      {:error, ~s(goto: x: expected a number, as in 2, -0.5 or 1.0e-3, got "abc")}
      iex> Robot.Command.parse("goto:1", [])
      {:error, "goto: y is missing: expected goto:X:Y or goto:X:Y:THETA"}
      iex> {:error, line} = Robot.Command.parse("goot:1:2", [])
      iex> line =~ ~r/^expected one of stop, move, goto, .*, got "goot"; did you mean goto\\?$/
      true
  """
  @spec parse(term(), [atom()]) :: {:ok, t()} | {:error, String.t()}
  def parse(text, known) when is_binary(text) and byte_size(text) <= @longest do
    if String.printable?(text),
      do: text |> String.trim() |> String.split(":") |> command(known),
      else: {:error, "a command cannot contain bytes that are not text"}
  end

  def parse(text, _known) when is_binary(text),
    do: {:error, "expected a command of at most #{@longest} bytes"}

  def parse(_text, _known), do: {:error, "expected a command as text, as in goto:2.0:1.0"}

  defp command([""], _known),
    do: {:error, "an empty command: expected one of #{Enum.join(@keywords, ", ")}"}

  defp command([word | arguments], known) do
    keyword = word |> String.trim() |> String.downcase()
    # Options in words may hold colons, too.
    arguments = if keyword in ["start", "run", "send"], do: joined(arguments), else: arguments

    case List.keyfind(@grammar, keyword, 0) do
      nil ->
        {:error,
         "expected one of #{Enum.join(@keywords, ", ")}, got #{inspect(word)}" <>
           Suggest.hint(keyword, @keywords)}

      {keyword, must, may} ->
        with {:ok, values} <- arguments(keyword, must, may, arguments, known),
             do: {:ok, build(keyword, values)}
    end
  end

  defp joined([mission | [_ | _] = options]), do: [mission, Enum.join(options, ":")]
  defp joined(arguments), do: arguments

  defp arguments(keyword, must, may, arguments, known) do
    names = must ++ may
    count = length(arguments)

    cond do
      count < length(must) ->
        {:error, "#{keyword}: #{Enum.at(must, count)} is missing: expected #{usage(keyword)}"}

      count > length(names) ->
        extra = Enum.at(arguments, length(names))
        {:error, "#{keyword}: expected #{usage(keyword)}, got also #{inspect(extra)}"}

      true ->
        values(keyword, Enum.zip(names, arguments), known, [])
    end
  end

  defp values(_keyword, [], _known, values), do: {:ok, Enum.reverse(values)}

  defp values(keyword, [{name, text} | rest], known, values) do
    case Command.Arguments.value(name, String.trim(text), known) do
      {:ok, value} ->
        values(keyword, rest, known, [value | values])

      {:error, allowed} ->
        {:error, "#{keyword}: #{name}: expected #{allowed}, got #{inspect(text)}"}
    end
  end

  defp usage(keyword) do
    {keyword, must, may} = List.keyfind(@grammar, keyword, 0)
    form = fn names -> Enum.join([keyword | Enum.map(names, &String.upcase("#{&1}"))], ":") end
    if may == [], do: form.(must), else: "#{form.(must)} or #{form.(must ++ may)}"
  end

  defp build("stop", []), do: :stop
  defp build("look", [pan]), do: {:look, pan}
  defp build("lead", []), do: :lead
  defp build("start", []), do: :start
  defp build("start", words), do: {:start, Enum.join(words, ":")}
  defp build("run", words), do: {:run, Enum.join(words, ":")}
  defp build("send", words), do: {:send, Enum.join(words, ":")}
  defp build("wander", []), do: :wander
  defp build("rest", []), do: :rest
  defp build("square", []), do: {:square, nil}
  defp build("square", [side]), do: {:square, side}
  defp build("ping", []), do: :ping
  defp build("keep", []), do: :keep
  defp build("arm", []), do: :arm
  defp build("disarm", []), do: :disarm
  defp build("acknowledge", []), do: :acknowledge
  defp build("move", [v, w]), do: {:move, v, w}
  defp build("move", [v, w, for_s]), do: {:move, v, w, for_s}
  defp build("goto", [x, y]), do: {:goto, x, y, nil}
  defp build("goto", [x, y, theta]), do: {:goto, x, y, theta}
  defp build("followtheleader", [id]), do: {:follow_the_leader, id}
  defp build("findblob", []), do: {:find_blob, nil}
  defp build("findblob", [colour]), do: {:find_blob, colour}
  defp build("subscribe", [id]), do: {:subscribe, id}
  defp build("unsubscribe", [id]), do: {:unsubscribe, id}
  defp build("position", [x, y, theta]), do: {:position, Pose.new(x, y, theta)}
  defp build("follow", [x, y, theta]), do: {:follow, Pose.new(x, y, theta)}

  defp build("blob", [x, y, theta, size, found]),
    do: {:blob, Pose.new(x, y, theta), size, found}

  @doc """
  The same for a command that is given as a term: as `parse/2` would return it, or one line that says what is allowed. Numbers
  are not checked.

      iex> Robot.Command.check({:goto, 2, 1, nil}, [:mag1])
      {:ok, {:goto, 2, 1, nil}}
      iex> Robot.Command.check({:follow_the_leader, :mag9}, [:mag1, :min1])
      {:error, "followtheleader: name: expected one of mag1, min1, got :mag9"}
      iex> Robot.Command.check(:reset, [])
      {:error, ~s(:reset is not a command; write one as text, such as "goto:2.0:1.0")}
  """
  @spec check(term(), [atom()]) :: {:ok, t()} | {:error, String.t()}
  def check(word, _known)
      when word in [
             :stop,
             :lead,
             :start,
             :wander,
             :rest,
             :ping,
             :keep,
             :arm,
             :disarm,
             :acknowledge
           ],
      do: {:ok, word}

  def check({word, text}, known) when word in [:start, :run, :send] and is_binary(text),
    do: parse("#{word}:#{text}", known)

  def check({:find_blob, "" <> colour}, known), do: parse("findblob:#{colour}", known)
  def check({:find_blob, nil} = command, _known), do: {:ok, command}

  def check({:follow_the_leader, name} = command, known) do
    if name in known,
      do: {:ok, command},
      else:
        {:error,
         "followtheleader: name: expected one of #{Enum.join(known, ", ")}, got #{inspect(name)}"}
  end

  def check(command, _known)
      when is_tuple(command) and
             elem(command, 0) in [
               :look,
               :move,
               :goto,
               :square,
               :subscribe,
               :unsubscribe,
               :position,
               :follow,
               :blob
             ],
      do: {:ok, command}

  def check(other, _known) do
    other = inspect(other, limit: 5, printable_limit: 40)
    {:error, "#{other} is not a command; write one as text, such as \"goto:2.0:1.0\""}
  end

  @doc """
  What a command is called.

      iex> Robot.Command.name({:move, 0.5, 0.0})
      :move
  """
  @spec name(t()) :: atom()
  def name(command) when is_atom(command), do: command
  def name(command), do: elem(command, 0)
end
