defmodule Lab.Trial.Event do
  @moduledoc """
  Describes the events of a run's script, as data. Pure. An entry of a script is `{at_s, event}`.

  | event | what happens |
  |---|---|
  | `{:kill, robot}` | stops for ever |
  | `{:move, {x, y}}` | the landmark glides there, or appears there if there is none |
  | `{:remove_landmark}` | the landmark is taken away |
  | `{:tell, robot, command}` | a person's command: `:start`, `:stop`, `{:formation, kind, spacing}`, or a text of `Robot.Command` |
  | `{:estop, robot}` | a person presses the emergency stop of this robot |
  | `{:reset}` | a person clears the emergency stop of all robots |
  | `{:cut, groups}` | the radio is cut (`Lab.Trial.Cuts`), besides what was cut before |
  | `{:join}` | all that the script has cut is whole again |
  | `{:loss, share}` | this share of the messages is lost from now on |
  | `{:freeze, robot, for_s}` | its processes get no processor: it hears, senses, thinks and sends nothing, its wheels stop 200 ms later |
  | `{:crash, robot, role}` | this part of its program crashes: `:gate`, `:executive`, `:pilot`, `:estop` or `:comms`; it and those behind it begin anew, the mission idle if it is among them |
  | `{:hang, robot, role, for_s}` | this part, `:executive` or `:pilot`, handles nothing; after 2 s it is killed, as by a crash |
  | `{:displace, robot, {x, y, heading_deg}}` | it is lifted to another place; its wheels do not count that |
  | `{:place, object, {x, y, heading_deg}}` | a ball or a box, such as `"ball1"`, is put elsewhere |
  | `{:blind, robot, for_s}` | its camera gives no pictures |
  | `{:deaf, robot, for_s}` | it receives no messages |

  A robot is its name or `:leader`, the one that leads at that time; `:tell` also takes `:all`.
  """
  alias Hal.Options.{Suggest, Type, Wording}
  alias Robot.Command
  alias Lab.Trial.{Cuts, Form}

  @type t :: tuple()
  @type entry :: {at_s :: number(), t()}

  # What a robot carries out itself; the others are for the wheels' person, or are never accepted.
  @alone ~w(move goto followtheleader findblob follow lead wander rest square run start)
  @longest_s 1_000_000

  @doc "The type of a script, in a table of `Hal.Options`."
  @spec script_type() :: Type.t()
  def script_type,
    do:
      {:list, {:check, &__MODULE__.read/1, "{at_s, event}, such as {20, {:kill, :leader}}"}, 1000}

  @doc """
  An entry with its numbers as floats, or what is wrong with it.

      iex> Lab.Trial.Event.read({20, {:freeze, :mag1, 3}})
      {:ok, {20.0, {:freeze, :mag1, 3.0}}}
      iex> Lab.Trial.Event.read({20, {:tell, :mag1, "goot:1:2"}})
      {:error, [{["command"], "expected :start, :stop, {:formation, kind, spacing} or a text " <>
        "with one of move, goto, followtheleader, findblob, follow, lead, wander, rest, square, run, start, got \\"goot:1:2\\"; did you mean goto?"}]}
  """
  @spec read(term()) :: Type.result() | false
  def read({at_s, event}) do
    with {:ok, at_s} <- under("at_s", Type.read({:number, 0, @longest_s, "s"}, at_s)),
         {:ok, event} <- Form.read(event, forms(), "an event"),
         do: {:ok, {at_s, event}}
  end

  def read(_other), do: false

  defp under(key, {:error, problems}),
    do: {:error, for({path, text} <- problems, do: {[key | path], text})}

  defp under(_key, result), do: result

  # All events, as forms of `Lab.Trial.Form`.
  defp forms do
    metres = {:number, -1.0e4, 1.0e4, "m"}
    place = {:tuple, [metres, metres], "{x, y} in metres"}
    degrees = {:number, -36_000, 36_000, "degrees"}
    pose = {:tuple, [metres, metres, degrees], "{x, y, heading_deg} in metres and degrees"}
    who = {:check, &name?/1, "a robot of this run, or :leader,"}
    told = {:check, &name?/1, "a robot of this run, :leader or :all"}
    for_s = {:number, 0.1, @longest_s, "s"}
    groups = {:check, &Type.list?/1, "a list of groups of robots, [[:mag1], [:mag2]],"}
    link = {:check, &link?/1, "{:link, robot, robot} or {:way, robot, robot}"}

    cut =
      {:check, &(Type.list?(&1) or link?(&1)),
       "#{Wording.allowed(groups)} or #{Wording.allowed(link)}"}

    [
      {:kill, [robot: who], []},
      {:move, [place: place], []},
      {:remove_landmark, [], []},
      {:tell, [robot: told, command: {:check, &command/1, "a command"}], []},
      {:estop, [robot: who], []},
      {:reset, [], []},
      {:cut, [groups: cut], []},
      {:join, [], []},
      {:loss, [share: {:number, 0, 1}], []},
      {:freeze, [robot: who, for_s: for_s], []},
      {:crash, [robot: who, role: {:one_of, [:gate, :executive, :pilot, :estop, :comms]}], []},
      {:hang, [robot: who, role: {:one_of, [:executive, :pilot]}, for_s: for_s], []},
      {:displace, [robot: who, pose: pose], []},
      {:place, [object: {:text, "the name of a ball or a box"}, pose: pose], []},
      {:blind, [robot: who, for_s: for_s], []},
      {:deaf, [robot: who, for_s: for_s], []}
    ]
  end

  defp name?(name), do: is_atom(name) and name not in [nil, true, false]
  defp link?({kind, a, b}), do: kind in [:link, :way] and name?(a) and name?(b)
  defp link?(_other), do: false

  defp command(command) when command in [:start, :stop], do: true

  defp command({:formation, kind, spacing}) do
    with {:ok, formation: {kind, spacing}} <-
           Type.read({:keys, formation: Swarm.Formation.type()}, formation: {kind, spacing}),
         do: {:ok, {:formation, kind, spacing}}
  end

  defp command(text) when is_binary(text) do
    word = text |> String.split(":") |> hd() |> String.trim() |> String.downcase()

    cond do
      word in ["start", "run"] -> named(text)
      word not in @alone -> refuse(text, Suggest.hint(word, @alone))
      # Which names there are is known later.
      word == "followtheleader" -> true
      true -> with {:ok, _command} <- Command.parse(text, []), do: true
    end
  end

  defp command(other), do: refuse(other, "")

  defp named(text) do
    with {:ok, command} <- Command.parse(text, []),
         {:ok, _request} <- Swarm.MissionRegistry.Text.request(command, nil),
         do: true
  end

  defp refuse(value, hint) do
    {:error,
     "expected :start, :stop, {:formation, kind, spacing} or a text " <>
       "with one of #{Enum.join(@alone, ", ")}, got #{Wording.show(value)}#{hint}"}
  end

  @doc """
  What is wrong with a script that was read, for these robots: each problem has the path to its
  entry.

      iex> Lab.Trial.Event.problems([{2.0, {:kill, :mga1}}], [:mag1, :mag2])
      [{["script", "1"], "expected a robot of this run, or :leader, got {:kill, :mga1}; did you mean :mag1?"}]
  """
  @spec problems([entry()], [atom()]) :: [Type.problem()]
  def problems(script, robots) do
    for {{_at_s, event}, n} <- Enum.with_index(script, 1),
        {text, hint} <- List.wrap(problem(event, robots)) do
      {:error, [{[], words}]} = Wording.refuse(text, event)
      {["script", "#{n}"], words <> hint}
    end
  end

  defp problem({:cut, what}, robots) do
    unless Cuts.valid?([{0, :end, what}], robots),
      do: {"groups of robots of this run, or a link between two of them,", ""}
  end

  defp problem({:tell, who, "" <> text} = event, robots) do
    case Command.parse(text, robots) do
      {:ok, _command} ->
        unknown(event, who, [:leader, :all | robots])

      {:error, line} ->
        {"a command", ": #{line}"}
    end
  end

  defp problem({:tell, who, _command} = event, robots),
    do: unknown(event, who, [:leader, :all | robots])

  defp problem(event, robots) do
    case robot(event) do
      nil -> nil
      who -> unknown(event, who, [:leader | robots])
    end
  end

  defp unknown(event, who, known) do
    {_label, {:check, _known?, what}} = event |> form() |> elem(1) |> hd()
    unless who in known, do: {what, Suggest.hint(inspect(who), known)}
  end

  defp form(event), do: List.keyfind(forms(), elem(event, 0), 0)

  @doc """
  The robot to which an event happens, or `nil`.

      iex> {Lab.Trial.Event.robot({:estop, :mag1}), Lab.Trial.Event.robot({:move, {1.0, 2.0}})}
      {:mag1, nil}
  """
  @spec robot(t()) :: atom()
  def robot({name, who})
      when name in [:kill, :estop],
      do: who

  def robot({name, who, _more}) when name in [:tell, :freeze, :crash, :displace, :blind, :deaf],
    do: who

  def robot({name, who, _what, _more}) when name in [:hang, :order_refused], do: who
  def robot(_event), do: nil

  @doc """
  The stage that tells of an event: its name, the robot, and facts.

      iex> for event <- [{:kill, :mag1}, {:tell, :all, :stop}, {:blind, :mag2, 3.0}], do: Lab.Trial.Event.stage(event)
      [{:killed, :mag1, %{}}, {:told, nil, %{command: :stop}}, {:blind, :mag2, %{for_s: 3.0}}]
  """
  @spec stage(t()) :: {name :: atom(), robot :: atom() | nil, facts :: map()}
  def stage({:kill, id}), do: {:killed, id, %{}}
  def stage({:move, nil}), do: {:landmark_removed, nil, %{}}
  def stage({:move, _place}), do: {:landmark_moved, nil, %{}}
  def stage({:remove_landmark}), do: {:landmark_removed, nil, %{}}
  def stage({:tell, :all, command}), do: {:told, nil, %{command: command}}
  def stage({:tell, id, command}), do: {:told, id, %{command: command}}
  def stage({:order_refused, id, told, why}), do: {:order_refused, id, %{command: told, why: why}}
  def stage({:estop, id}), do: {:estop, id, %{}}
  def stage({:reset}), do: {:reset, nil, %{}}
  def stage({:cut, _what}), do: {:radio_cut, nil, %{}}
  def stage({:join}), do: {:radio_whole, nil, %{}}
  def stage({:loss, share}), do: {:radio_loss, nil, %{share: share}}
  def stage({:displace, id, _pose}), do: {:displaced, id, %{}}
  def stage({:place, id, _pose}), do: {:placed, nil, %{object: id}}
  def stage({:crash, id, role}), do: {:crashed, id, %{crash: "its #{role}, by the script"}}
  def stage({:hang, id, role, for_s}), do: {:hangs, id, %{role: role, for_s: for_s}}
  def stage({:freeze, id, for_s}), do: {:frozen, id, %{for_s: for_s}}
  def stage({kind, id, for_s}) when kind in [:blind, :deaf], do: {kind, id, %{for_s: for_s}}

  @doc "What robots are told by the command of an event, which was read for a run with these robots."
  @spec request(command :: term(), [atom()]) :: term()
  def request("" <> text, robots) do
    {:ok, command} = Command.parse(text, robots)
    {:ok, request} = Swarm.MissionRegistry.Text.request(command, length(robots))
    request
  end

  def request(command, _robots), do: command

  @doc "The event with the leader's name for `:leader`."
  @spec name(t(), leader :: atom() | nil) :: t()
  def name(event, leader),
    do: if(robot(event) == :leader, do: put_elem(event, 1, leader), else: event)

  @doc "For how many seconds an event lasts; 0 if it is done at once."
  @spec lasts_s(t()) :: number()
  def lasts_s({name, _robot, for_s}) when name in [:freeze, :blind, :deaf], do: for_s
  def lasts_s({:hang, _robot, _role, for_s}), do: for_s
  def lasts_s(_event), do: 0
end
